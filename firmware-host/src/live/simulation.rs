//! The live loop in one thread and in virtual time: what would take minutes takes milliseconds, and happens alike each time.

use std::{
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicU64},
    },
    time::Duration,
};

use fencepost_hal::{
    camera::Camera,
    can::CanBus,
    clock::{Clock, VirtualClock},
};

use super::{
    Event, Plan, RunReport,
    bus::{BusLoop, BusPlan, BusShared},
    check_number,
    event::Events,
    exchange::{Bell, Place},
    pair::{PairLoop, PairShared},
    sight::Sight,
};
use crate::error::Failure;

/// Runs the loop as [`run`](super::run) does, but each step of its threads when it is due by `clock`, one after the other: a step takes
/// no time. `pace` tells how long the camera of a pair takes until its next picture, by the pair's index; the pair is looked at then.
/// Ends when no camera will deliver any more. Nothing is asked of the operating system.
///
/// Each pair has one of `sights` to look with, which is configured already, and may be smaller than the program's detectors.
///
/// # Errors
/// When a setting cannot be used, and where there is not one sight for each pair. Nothing was sent then.
pub fn simulate<C: Camera, B: CanBus, S: Sight>(
    plan: Plan<C>,
    sights: &mut [S],
    bus: B,
    clock: &VirtualClock,
    mut pace: impl FnMut(usize) -> Duration,
    mut observe: impl FnMut(&Event),
) -> Result<RunReport, Failure> {
    let Plan { pairs, wire, settings, sector_width_deg } = plan;
    check_number(&pairs)?;
    if sights.len() != pairs.len() {
        return Err(Failure::usage(format!(
            "{} pairs of cameras cannot look with {} sights",
            pairs.len(),
            sights.len()
        )));
    }
    let forget_ns = u64::from(settings.stale_ms) * 1_000_000;
    let places: Vec<Place> = pairs.iter().map(|_| Place::new()).collect();
    let (bell, events, progress) = (Bell::default(), Events::default(), Mutex::default());
    let (stop, alive) = (AtomicBool::new(false), AtomicU64::new(0));
    let shared = BusShared {
        places: &places,
        bell: &bell,
        events: &events,
        stop: &stop,
        progress: &progress,
        alive: &alive,
        clock,
    };
    let mut bus = BusLoop::new(shared, bus, BusPlan { wire, settings: &settings, sector_width_deg })?;
    let mut running = Vec::new();
    for ((plan, sight), place) in pairs.into_iter().zip(sights).zip(&places) {
        let shared = PairShared { place, bell: &bell, events: &events, clock };
        running.push((PairLoop::new(&plan.name, plan.camera, forget_ns, shared), sight));
    }
    let after = |wait: Duration| clock.now_ns().saturating_add(u64::try_from(wait.as_nanos()).unwrap_or(u64::MAX));
    let mut due_ns: Vec<Option<u64>> = (0..running.len()).map(|index| Some(after(pace(index)))).collect();
    let mut tell = || std::iter::from_fn(|| events.next()).for_each(|event| observe(&event));

    bus.begin();
    let mut bus_due_ns = clock.now_ns();
    loop {
        let next = due_ns.iter().enumerate().filter_map(|(index, due_ns)| Some((due_ns.as_ref()?, index))).min();
        match next {
            // What a pair has seen rings the bell.
            Some((&pair_due_ns, index)) if pair_due_ns <= bus_due_ns => {
                clock.advance_to(pair_due_ns);
                let (pair, sight) = &mut running[index];
                due_ns[index] = pair.step(*sight).map(|rest| after(rest.saturating_add(pace(index))));
                bus_due_ns = clock.now_ns();
            }
            _ => {
                clock.advance_to(bus_due_ns);
                match bus.step() {
                    Some(longest) => bus_due_ns = after(longest),
                    None => break,
                }
            }
        }
        tell();
    }
    let bus = bus.end();
    tell();
    let pairs = running.into_iter().map(|(pair, _)| pair.end()).collect();
    Ok(RunReport { pairs, bus, events_dropped: events.dropped() })
}
