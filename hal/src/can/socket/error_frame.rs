//! Error frames: how the kernel tells what a CAN controller has met.
//!
//! Source: Linux, include/uapi/linux/can/error.h. The class is in the identifier, a bit each; details are in the data.

use crate::can::{BusCondition, ControllerState};

/// The controller could not send within the time it has.
const TX_TIMEOUT: u32 = 0x1;
/// Arbitration lost; bit number in data 0.
const LOST_ARBITRATION: u32 = 0x2;
/// Controller problems and state, in data 1.
const CONTROLLER: u32 = 0x4;
/// Protocol violations: type in data 2, place in data 3.
const PROTOCOL: u32 = 0x8;
/// Transceiver, in data 4.
const TRANSCEIVER: u32 = 0x10;
/// Nobody acknowledged.
const NO_ACKNOWLEDGEMENT: u32 = 0x20;
/// Off the bus.
const BUS_OFF: u32 = 0x40;
/// Bus error.
const BUS_ERROR: u32 = 0x80;
/// Restarted.
const RESTARTED: u32 = 0x100;

/// In data 1: a frame was lost because the controller's memory was full.
const RX_OVERFLOW: u8 = 0x01;
const TX_OVERFLOW: u8 = 0x02;
/// In data 1: warning level reached, receiving or sending.
const WARNING: u8 = 0x04 | 0x08;
/// In data 1: error-passive, receiving or sending.
const PASSIVE: u8 = 0x10 | 0x20;
/// In data 1: back in the state error-active.
const ACTIVE: u8 = 0x40;

/// In data 3: the violation was in the acknowledge slot. Some drivers tell a missing acknowledgement in this way only.
const PLACE_ACKNOWLEDGE: u8 = 0x19;

/// Everything that is told: the mask for `CAN_RAW_ERR_FILTER`.
pub(super) const ALL_CLASSES: u32 = 0x1FFF_FFFF;

/// Takes note of an error frame: its identifier without the flags, and its data.
pub(super) fn take_note(condition: &mut BusCondition, class: u32, data: &[u8]) {
    let has = |bit: u32| class & bit != 0;
    let byte = |place: usize| data.get(place).copied().unwrap_or(0);
    let controller = if has(CONTROLLER) { byte(1) } else { 0 };

    let no_acknowledgement = has(NO_ACKNOWLEDGEMENT) || (has(PROTOCOL) && byte(3) == PLACE_ACKNOWLEDGE);
    let trouble = has(TX_TIMEOUT | PROTOCOL | TRANSCEIVER | NO_ACKNOWLEDGEMENT | BUS_OFF | BUS_ERROR)
        || controller & (RX_OVERFLOW | TX_OVERFLOW | WARNING | PASSIVE) != 0;
    count(&mut condition.errors, trouble);
    count(&mut condition.no_acknowledgement, no_acknowledgement);
    count(&mut condition.lost_arbitrations, has(LOST_ARBITRATION));
    count(&mut condition.overflows, controller & RX_OVERFLOW != 0);
    count(&mut condition.restarts, has(RESTARTED));

    if has(RESTARTED) || controller & ACTIVE != 0 {
        condition.controller = ControllerState::ErrorActive;
    }
    if controller & PASSIVE != 0 {
        condition.controller = ControllerState::ErrorPassive;
    } else if controller & WARNING != 0 {
        condition.controller = ControllerState::Warning;
    }
    if has(BUS_OFF) {
        condition.controller = ControllerState::BusOff;
    }
}

fn count(counter: &mut u32, happened: bool) {
    *counter = counter.saturating_add(u32::from(happened));
}

#[cfg(test)]
mod tests {
    use super::*;
    use ControllerState::{BusOff, ErrorActive, ErrorPassive, Warning};

    /// The condition after error frames, each as class and data.
    fn after(frames: &[(u32, [u8; 8])]) -> BusCondition {
        let mut condition = BusCondition::default();
        frames.iter().for_each(|(class, data)| take_note(&mut condition, *class, data));
        condition
    }

    fn controller(bits: u8) -> (u32, [u8; 8]) {
        (0x004, [0, bits, 0, 0, 0, 0, 0, 0])
    }

    #[test]
    fn each_class_is_counted_where_it_belongs() {
        let none = BusCondition::default();
        let error = BusCondition { errors: 1, ..none };
        for (class, data, expected) in [
            (0x001, [0; 8], error), // sending took too long
            (0x002, [7, 0, 0, 0, 0, 0, 0, 0], BusCondition { lost_arbitrations: 1, ..none }),
            (0x004, [0; 8], none), // controller, unspecified
            (0x004, [0, 0x01, 0, 0, 0, 0, 0, 0], BusCondition { overflows: 1, ..error }),
            (0x004, [0, 0x02, 0, 0, 0, 0, 0, 0], error),    // no room to send
            (0x008, [0, 0, 0x04, 0x0A, 0, 0, 0, 0], error), // stuff error in the data
            (0x008, [0, 0, 0, 0x19, 0, 0, 0, 0], BusCondition { no_acknowledgement: 1, ..error }),
            (0x010, [0, 0, 0, 0, 0x04, 0, 0, 0], error), // no wire
            (0x020, [0; 8], BusCondition { no_acknowledgement: 1, ..error }),
            (0x040, [0; 8], BusCondition { controller: BusOff, ..error }),
            (0x080, [0; 8], error),
            (0x100, [0; 8], BusCondition { restarts: 1, ..none }),
            (0x200, [0, 0, 0, 0, 0, 0, 96, 12], none), // counters only
            // As flexcan and mcp251xfd tell that nobody acknowledges.
            (0x0A8, [0, 0, 0, 0x19, 0, 0, 0, 0], BusCondition { no_acknowledgement: 1, ..error }),
        ] {
            assert_eq!(after(&[(class, data)]), expected, "class {class:#x}, data {data:02x?}");
        }
    }

    #[test]
    fn the_state_of_the_controller_follows_every_way_through_fault_confinement() {
        let state = |frames: &[(u32, [u8; 8])]| after(frames).controller;
        for (bits, expected) in [
            (0x04, Warning),
            (0x08, Warning),
            (0x0C, Warning),
            (0x10, ErrorPassive),
            (0x20, ErrorPassive),
            (0x30, ErrorPassive),
            (0x18, ErrorPassive),
            (0x40, ErrorActive),
        ] {
            for before in [0x04, 0x10, 0x40] {
                assert_eq!(state(&[controller(before), controller(bits)]), expected, "{before:#x}, then {bits:#x}");
            }
        }
        let (off, restarted) = ((0x040, [0; 8]), (0x100, [0; 8]));
        assert_eq!(state(&[controller(0x20), off]), BusOff);
        assert_eq!(state(&[(0x044, [0, 0x20, 0, 0, 0, 0, 0, 0])]), BusOff, "both in one frame");
        assert_eq!(state(&[off, restarted]), ErrorActive);
        assert_eq!(state(&[off, (0x104, [0, 0x08, 0, 0, 0, 0, 0, 0])]), Warning, "restarted, and told where it stands");
        // A controller that brings no news of its state leaves it as it is.
        assert_eq!(state(&[controller(0x20), (0x088, [0; 8]), (0x002, [0; 8]), controller(0x01)]), ErrorPassive);
    }

    #[test]
    fn counts_stay_at_their_largest_value_and_short_data_are_read() {
        let mut condition = BusCondition { errors: u32::MAX, no_acknowledgement: u32::MAX, ..BusCondition::default() };
        take_note(&mut condition, 0x02C, &[]);
        assert_eq!((condition.errors, condition.no_acknowledgement), (u32::MAX, u32::MAX));
        for class in 0..=0x3FF {
            take_note(&mut condition, class, &[0xFF; 8]);
            take_note(&mut condition, class | 0xFFFF_FC00, &[0xFF]);
        }
    }
}
