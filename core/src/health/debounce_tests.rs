//! When reasons are told and when no longer.

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
    assert_eq!(told(SOFT, 0, 0, &[Blind, Ok]), [Blind, Ok], "zero counts as one");
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
