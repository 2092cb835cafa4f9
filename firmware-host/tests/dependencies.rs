//! `docs/dependencies.md` names what the packages of the workspace depend on, and nothing else; and what may not be among all that
//! comes with it: other licences, other places to come from, crates that fetch. Advisories need a network and are not looked at.

use std::{collections::BTreeSet, fs, path::Path, process::Command};

use toml::{Table, Value};

#[test]
fn every_dependency_is_in_the_list_and_the_list_has_no_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let table = |folder: &Path| -> Table { fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap() };
    let members = table(root)["workspace"]["members"].as_array().unwrap().clone();
    let mut used = BTreeSet::new();
    for member in members.iter().map(|member| member.as_str().unwrap()).chain(["fuzz"]) {
        collect(&table(&root.join(member)), &mut used);
    }
    assert!(members.len() >= 5 && used.len() > 30, "{members:?} use {used:?}");
    let list = fs::read_to_string(root.join("docs/dependencies.md")).unwrap();
    let rows = list.lines().filter_map(|line| line.strip_prefix("| `")?.split_once('`'));
    let told: BTreeSet<String> = rows.map(|(name, _)| name.to_owned()).collect();
    assert_eq!(told, used, "docs/dependencies.md and the Cargo.toml files");
}

/// Names of all dependencies that a manifest has, whatever for; packages of the workspace aside.
fn collect(manifest: &Table, used: &mut BTreeSet<String>) {
    for (key, value) in manifest {
        let Value::Table(inner) = value else { continue };
        match key.as_str() {
            "dependencies" | "dev-dependencies" | "build-dependencies" => {
                used.extend(inner.keys().filter(|name| !name.starts_with("fencepost")).cloned());
            }
            // By target, and one level below.
            "target" => inner.values().filter_map(Value::as_table).for_each(|table| collect(table, used)),
            _ => {}
        }
    }
}

/// Licences that the product can be given away under.
const LICENCES: [&str; 10] =
    ["MIT", "Apache-2.0", "Zlib", "BSD-2-Clause", "BSD-3-Clause", "0BSD", "BSL-1.0", "IJG", "Unicode-3.0", "Unlicense"];

/// Crates that open connections: neither the robot nor a build may. And those that the core was written without.
const BANNED: [&str; 14] = [
    "attohttpc",
    "curl",
    "curl-sys",
    "git2",
    "gix",
    "hyper",
    "isahc",
    "native-tls",
    "openssl-sys",
    "quinn",
    "reqwest",
    "rustls",
    "tokio",
    "ureq",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// Every package of the lock files: name, version and where it comes from.
fn locked() -> Vec<(String, String, Option<String>)> {
    let mut packages = Vec::new();
    for file in ["Cargo.lock", "bounds/image/Cargo.lock"] {
        let lock: Table = fs::read_to_string(root().join(file)).unwrap().parse().unwrap();
        for package in lock["package"].as_array().unwrap() {
            let text = |key: &str| package.get(key).and_then(Value::as_str).map(str::to_owned);
            packages.push((text("name").unwrap(), text("version").unwrap(), text("source")));
        }
    }
    packages
}

/// Our own packages have no source; all others come from the registry, none from a repository or another registry.
fn comes_from_elsewhere(name: &str, source: Option<&str>) -> bool {
    match source {
        None => !name.starts_with("fencepost"),
        Some(source) => !(source.starts_with("registry+") && source.ends_with("/crates.io-index")),
    }
}

#[test]
fn everything_comes_from_the_registry_and_nothing_fetches() {
    let packages = locked();
    assert!(packages.len() > 200, "{} packages", packages.len());
    for (name, version, source) in &packages {
        assert!(!comes_from_elsewhere(name, source.as_deref()), "{name} {version} comes from {source:?}");
        assert!(!BANNED.contains(&name.as_str()), "{name} {version} is banned");
    }
    // What is planted is caught.
    assert!(comes_from_elsewhere("some", Some("git+https://example.org/some.git#0123")));
    assert!(comes_from_elsewhere("some", Some("registry+https://example.org/index")));
    assert!(comes_from_elsewhere("some", None) && !comes_from_elsewhere("fencepost-core", None));
}

#[test]
fn what_the_core_uses_is_there_once() {
    let core: Table = fs::read_to_string(root().join("core/Cargo.toml")).unwrap().parse().unwrap();
    let packages = locked();
    for name in core["dependencies"].as_table().unwrap().keys() {
        let versions: BTreeSet<&String> =
            packages.iter().filter(|(other, ..)| other == name).map(|(_, version, _)| version).collect();
        assert_eq!(versions.len(), 1, "{name} in {versions:?}");
    }
}

#[test]
fn every_licence_is_one_of_those_that_are_allowed() {
    // What is built for Linux on x86-64; the licences of crates for other systems are looked at where they are built.
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline"])
        .args(["--filter-platform", "x86_64-unknown-linux-gnu"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 200, "{} packages", packages.len());
    for package in packages {
        let licence = package["license"].as_str().unwrap_or("");
        assert!(allows(licence), "{}: {licence:?}", package["name"]);
    }
    for good in [
        "MIT",
        "MIT/GPL-3.0",
        "Apache-2.0 WITH LLVM-exception OR GPL-2.0",
        "(MIT OR GPL-2.0) AND IJG",
        "MIT or LGPL-3.0",
    ] {
        assert!(allows(good), "{good}");
    }
    for bad in [
        "",
        "GPL-3.0",
        "MIT AND GPL-3.0",
        "(MIT OR Zlib) AND CC-BY-4.0",
        "MIT WITH",
        "MIT OR",
        "(MIT",
        "MIT)",
        "MIT Zlib",
    ] {
        assert!(!allows(bad), "{bad}");
    }
}

/// Whether a licence expression (SPDX, and the older way with a slash) can be met with those that are allowed.
fn allows(expression: &str) -> bool {
    let spaced = expression.replace('/', " OR ").replace(" or ", " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    any_of(&mut rest) == Some(true) && rest.is_empty()
}

fn any_of(words: &mut &[&str]) -> Option<bool> {
    let mut allowed = all_of(words)?;
    while let ["OR", rest @ ..] = words {
        *words = rest;
        allowed |= all_of(words)?;
    }
    Some(allowed)
}

fn all_of(words: &mut &[&str]) -> Option<bool> {
    let mut allowed = one(words)?;
    while let ["AND", rest @ ..] = words {
        *words = rest;
        allowed &= one(words)?;
    }
    Some(allowed)
}

fn one(words: &mut &[&str]) -> Option<bool> {
    match words {
        ["(", rest @ ..] => {
            *words = rest;
            let allowed = any_of(words)?;
            let [")", rest @ ..] = words else { return None };
            *words = rest;
            Some(allowed)
        }
        // Exceptions only take away what a licence demands.
        [name, "WITH", exception, rest @ ..] if !["(", ")", "AND", "OR"].contains(exception) => {
            *words = rest;
            Some(LICENCES.contains(name))
        }
        [name, rest @ ..] if !["(", ")", "AND", "OR", "WITH"].contains(name) => {
            *words = rest;
            Some(LICENCES.contains(name))
        }
        _ => None,
    }
}
