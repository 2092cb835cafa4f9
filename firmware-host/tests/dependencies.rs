//! `docs/dependencies.md` names what the packages of the workspace depend on, and nothing else. What may come with it is held by
//! `tests/supply`.

use std::{collections::BTreeSet, fs, path::Path};

use toml::{Table, Value};

#[test]
fn every_dependency_is_in_the_list_and_the_list_has_no_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let table = |folder: &Path| -> Table { fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap() };
    let members = table(root)["workspace"]["members"].as_array().unwrap().clone();
    let mut used = BTreeSet::new();
    for member in members.iter().map(|member| member.as_str().unwrap()).chain(["fuzz", "tests/weave"]) {
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
