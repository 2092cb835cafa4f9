//! Weaves many mutants into one program, each behind a number that is chosen when the program starts: a build serves them all, where
//! cargo-mutants has one for each.
//!
//! usage: fencepost-weave MUTANTS.json TREE LEFT_OUT
//!
//! MUTANTS.json is what `cargo mutants --list --json` says; a mutant's number is its place there, counted from 1. Files in TREE are
//! written anew. LEFT_OUT has the numbers that are not woven in, since the compiler refused them. What is printed is a line for each
//! mutant that is woven in: its number, its file, the bytes of the file that belong to it, and whether it is in a `const fn`.

mod sites;

use sites::{Insertion, Mutant};
use std::collections::{BTreeMap, HashSet};
use std::{env, fs};

/// The number of the mutant that runs, 0 for none; it is 0 too where the compiler computes.
const CHOICE: &str = r#"
pub(crate) mod mutant {
    extern crate std;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
    static CHOSEN: AtomicU32 = AtomicU32::new(u32::MAX);
    fn read() -> u32 {
        match CHOSEN.load(Relaxed) {
            u32::MAX => first(),
            chosen => chosen,
        }
    }
    #[cold]
    fn first() -> u32 {
        let chosen = std::env::var("MUTANT").map_or(0, |text| text.parse().unwrap());
        CHOSEN.store(chosen, Relaxed);
        chosen
    }
    const fn none() -> u32 {
        0
    }
    pub(crate) const fn on() -> u32 {
        core::intrinsics::const_eval_select((), none, read)
    }
}
"#;

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [list, tree, left_out] = &arguments[..] else { panic!("usage: fencepost-weave MUTANTS.json TREE LEFT_OUT") };
    let read = |path: &str| fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let left_out: HashSet<usize> = read(left_out).split_whitespace().map(|number| number.parse().unwrap()).collect();
    let list: serde_json::Value = serde_json::from_str(&read(list)).expect("the list is JSON");
    let mut files: BTreeMap<&str, Vec<Mutant>> = BTreeMap::new();
    for (number, mutant) in (1..).zip(list.as_array().expect("a list")) {
        if !left_out.contains(&number) {
            let file = mutant["file"].as_str().expect("a file");
            files.entry(file).or_default().push(Mutant::new(number, mutant));
        }
    }
    for (file, mutants) in &files {
        let path = format!("{tree}/{file}");
        let source = read(&path);
        fs::write(&path, woven(file, &source, sites::find(&source, mutants))).expect("written");
    }
    let path = format!("{tree}/core/src/lib.rs");
    let attributes =
        "#![no_std]\n#![feature(core_intrinsics, const_eval_select)]\n#![allow(warnings, internal_features)]";
    fs::write(&path, read(&path).replace("#![no_std]", attributes) + CHOICE).expect("written");
}

/// The source with everything inserted; prints where the mutants lie in it.
fn woven(file: &str, source: &str, mut insertions: Vec<Insertion>) -> String {
    insertions.sort_by_key(|insertion| insertion.order);
    let (mut text, mut at) = (String::new(), 0);
    for insertion in insertions {
        let place = insertion.order.0;
        text += &source[at..place];
        at = place;
        for (part, mutant) in insertion.parts {
            if let Some((number, constant)) = mutant {
                println!("{number} {file} {} {} {constant}", text.len(), text.len() + part.len());
            }
            text += &part;
        }
    }
    text + &source[at..]
}
