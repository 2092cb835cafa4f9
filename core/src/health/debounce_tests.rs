//! When reasons are told and when no longer.

use std::{format, string::String};

use super::*;

const SOFT: HealthReason = HealthReason::Blocked;
const PLAIN: HealthReason = HealthReason::FrozenPicture;

/// What is told of `reason` while it is found at these levels.
fn told(reason: HealthReason, trigger: u8, release: u8, levels: &[HealthLevel]) -> std::vec::Vec<HealthLevel> {
    let mut debounce = Debounce::new(trigger, release);
    levels
        .iter()
        .map(|level| {
            let mut found = Findings::NONE;
            found.raise(reason, *level);
            let health = debounce.update(&found);
            assert_eq!(health, debounce.told());
            assert_eq!(health.has(reason), health.level > HealthLevel::Ok);
            health.level
        })
        .collect()
}

#[test]
fn estimates_are_told_when_found_twice_and_all_until_gone_for_long_enough() {
    use HealthLevel::{Blind, Degraded, Ok};
    assert_eq!(told(SOFT, 2, 3, &[Blind, Ok, Blind, Ok, Ok]), [Ok; 5], "flicker");
    assert_eq!(
        told(SOFT, 2, 3, &[Blind, Blind, Ok, Ok, Blind, Ok, Ok, Ok]),
        [Ok, Blind, Blind, Blind, Blind, Blind, Blind, Ok]
    );
    assert_eq!(told(PLAIN, 2, 3, &[Blind, Ok, Ok, Ok, Blind]), [Blind, Blind, Blind, Ok, Blind], "at once");
    assert_eq!(told(SOFT, 1, 1, &[Ok, Blind, Ok]), [Ok, Blind, Ok]);
    // Worse at once, better after a while.
    assert_eq!(
        told(SOFT, 2, 2, &[Degraded, Degraded, Blind, Degraded, Degraded, Ok, Ok]),
        [Ok, Degraded, Blind, Blind, Degraded, Degraded, Ok]
    );
    assert_eq!(
        told(SOFT, 2, 3, &[Degraded, Degraded, Ok, Blind]),
        [Ok, Degraded, Degraded, Blind],
        "worse after a pause"
    );
    assert_eq!(told(SOFT, 0, 0, &[Blind, Ok]), [Blind, Ok], "zero counts as one");
}

#[test]
fn an_interruption_begins_every_count_anew_and_changes_nothing_that_is_told() {
    let mut found = Findings::NONE;
    found.raise(SOFT, HealthLevel::Degraded);
    let mut debounce = Debounce::new(2, 2);
    assert_eq!(debounce.update(&found), Health::OK);
    debounce.interrupt();
    assert_eq!(debounce.update(&found), Health::OK, "the first again");
    let told = debounce.update(&found);
    assert!(told.has(SOFT));
    debounce.interrupt();
    assert_eq!(debounce.told(), told);

    assert_eq!(debounce.update(&Findings::NONE), told);
    debounce.interrupt();
    assert_eq!(debounce.update(&Findings::NONE), told, "gone for the first time again");
    assert_eq!(debounce.update(&Findings::NONE), Health::OK);
}

#[test]
fn reasons_are_called_as_in_the_code_and_each_has_words_of_its_own() {
    for (bit, reason) in HealthReason::ALL.into_iter().enumerate() {
        let mut name = String::new();
        for letter in format!("{reason:?}").chars() {
            if letter.is_uppercase() && !name.is_empty() {
                name.push('_');
            }
            name.extend(letter.to_lowercase());
        }
        assert_eq!((reason.name(), reason as usize), (name.as_str(), bit));
        let others = HealthReason::ALL.into_iter().filter(|other| *other != reason);
        assert!(!reason.describe().is_empty() && others.clone().all(|other| other.describe() != reason.describe()));
    }
    // What is estimated, or may be a single message or frame by chance.
    let not_plain = HealthReason::ALL.into_iter().filter(|reason| !reason.is_plain()).map(HealthReason::name);
    assert!(not_plain.eq(["blocked", "badly_paired", "badly_rectified", "late", "command_trouble"]));
}

#[test]
fn reasons_do_not_mix() {
    let mut debounce = Debounce::new(2, 2);
    let mut both = Findings::NONE;
    both.raise(SOFT, HealthLevel::Degraded);
    both.raise(PLAIN, HealthLevel::Blind);
    assert_eq!(debounce.update(&both).reasons, 1 << PLAIN as u8);
    let mut soft = Findings::NONE;
    soft.raise(SOFT, HealthLevel::Degraded);
    assert_eq!(debounce.update(&soft).reasons, 1 << PLAIN as u8 | 1 << SOFT as u8);
    let health = debounce.update(&soft);
    assert_eq!((health.level, health.reasons), (HealthLevel::Degraded, 1 << SOFT as u8));
    assert_eq!(debounce.update(&Findings::NONE).reasons, 1 << SOFT as u8);
    assert_eq!(debounce.update(&Findings::NONE), Health::OK, "healthy again by itself");
}

#[test]
fn findings_keep_the_worst_of_each_reason() {
    let mut findings = Findings::default();
    for reason in HealthReason::ALL {
        assert_eq!(findings.level(reason), HealthLevel::Ok);
        findings.raise(reason, HealthLevel::Blind);
        findings.raise(reason, HealthLevel::Degraded);
        assert_eq!(findings.level(reason), HealthLevel::Blind);
    }
    assert_eq!(findings.health(), Health { level: HealthLevel::Blind, reasons: (1 << HealthReason::ALL.len()) - 1 });
    let degraded = Health { level: HealthLevel::Degraded, reasons: 5 };
    assert_eq!(
        degraded.and(Health { level: HealthLevel::Fault, reasons: 2 }),
        Health { level: HealthLevel::Fault, reasons: 7 }
    );
}
