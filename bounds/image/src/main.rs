//! Fencepost on a Cortex-M7: pictures in, CAN payloads out, without operating system and heap.
//!
//! Runs on QEMU's `mps2-an500`. Pictures are laid into the board's outer memory by the simulator, and copied from there into
//! two buffers in RAM, where a camera's direct memory access would put them. What is found is printed by semihosting:
//! ```text
//! memory detector BYTES pictures BYTES
//! case NAME backend BACKEND
//! frame NUMBER
//! stage NAME INSTRUCTIONS
//! stack ENTRY BYTES
//! can IDENTIFIER#PAYLOAD
//! done
//! ```
#![no_std]
#![no_main]

mod board;
mod case;
mod clock;
mod robot;
mod stack;

use cortex_m::Peripherals;
use cortex_m_rt::entry;
use cortex_m_semihosting::{hprint, hprintln};
use embedded_can::StandardId;
use fencepost_core::{
    arch::Backend,
    detector::{DetectError, Detector, Stage},
    error::ConfigError,
    picture::Picture,
    wire::{EncodeReport, Frame, OutputFull, ScanEncoder},
};
use heapless::{Vec, VecView};

use board::fail;
use case::{Case, Cases, Setup};
use clock::Clock;
use robot::{FRAMES, HEIGHT, RUNS, RobotDetection, RobotDetector, WIDTH};

/// Where the simulator puts the pictures.
const PICTURES: usize = 0x6000_0000;

/// Bytes that lie there.
const ROOM: usize = 16 << 20;

/// All that the robot holds.
struct Robot {
    detector: &'static mut RobotDetector,
    encoder: &'static mut Option<ScanEncoder<RUNS>>,
    frames: &'static mut Vec<Frame, FRAMES>,
    /// Left and right, as a camera would deliver them.
    pictures: &'static mut [[u8; WIDTH * HEIGHT]; 2],
    clock: Clock,
}

#[entry]
fn main() -> ! {
    // All zero, so that they take no room in the flash.
    static mut DETECTOR: RobotDetector = Detector::new();
    static mut FRAMES_OF_SCAN: Vec<Frame, FRAMES> = Vec::new();
    static mut PAIR: [[u8; WIDTH * HEIGHT]; 2] = [[0; WIDTH * HEIGHT]; 2];
    static mut ENCODER: Option<ScanEncoder<RUNS>> = None;

    hprintln!("memory detector {} pictures {}", size_of::<RobotDetector>(), size_of_val(PAIR));
    let Some(cases) = cases() else { fail("there are no pictures; see bounds/image/run") };
    let Some(peripherals) = Peripherals::take() else { fail("the timer is taken") };
    let (detector, encoder, frames, pictures) = (DETECTOR, ENCODER, FRAMES_OF_SCAN, PAIR);
    let mut clock = Clock::new(peripherals.SYST);
    if !clock.counts() {
        fail("the timer does not count instructions: QEMU needs -icount shift=0");
    }
    let mut robot = Robot { detector, encoder, frames, pictures, clock };
    for case in cases {
        for &backend in Backend::ALL.iter().filter(|backend| backend.is_available()) {
            hprintln!("case {} backend {}", case.name, backend.name());
            robot.run(&case, backend);
        }
    }
    hprintln!("done");
    board::succeed()
}

/// The pictures, where they were laid.
fn cases() -> Option<Cases<'static>> {
    // SAFETY: the board has that much memory there, nobody writes to it, and any bytes are bytes.
    let memory: &'static [u8] = unsafe { core::slice::from_raw_parts(PICTURES as *const u8, ROOM) };
    Cases::new(memory.get(..Cases::length(memory)?)?)
}

impl Robot {
    fn run(&mut self, case: &Case<'_>, backend: Backend) {
        // Counters of messages go on from scan to scan: every run begins with those of a node that has just started.
        *self.encoder = ScanEncoder::new(robot::WIRE).ok();
        let (configured, depth) = stack::depth_of(|| entry_configure(self.detector, &case.setup, backend));
        if let Err(error) = configured {
            hprintln!("{}", error);
            fail("the case cannot be configured");
        }
        hprintln!("stack configure {}", depth);
        for (index, pair) in case.pairs().enumerate() {
            hprintln!("frame {}", index);
            for (buffer, pixels) in self.pictures.iter_mut().zip(pair) {
                let Some(buffer) = buffer.get_mut(..pixels.len()) else { fail("the pictures are too large") };
                buffer.copy_from_slice(pixels);
            }
            self.look(case, index as u16);
        }
    }

    fn look(&mut self, case: &Case<'_>, scan_index: u16) {
        let [left, right] = &*self.pictures;
        let pixels = case.size.0 * case.size.1;
        let [Some(left), Some(right)] =
            [left, right].map(|picture| picture.get(..pixels).and_then(|pixels| case.picture(pixels)))
        else {
            fail("the pictures are too small")
        };
        let clock = &mut self.clock;
        clock.begin();
        let (detected, depth) = stack::depth_of(|| entry_detect(self.detector, &[left, right], clock));
        if detected.is_err() {
            fail("the pictures have another size than the cameras");
        }
        let detect = self.clock.instructions();
        for (stage, instructions) in Stage::ALL.iter().zip(detect) {
            hprintln!("stage {} {}", stage.name(), instructions);
        }
        hprintln!("stack detect {}", depth);
        self.frames.clear();
        self.clock.begin();
        let Some(encoder) = self.encoder else { fail("the wire cannot be configured") };
        let detection = self.detector.detection();
        let frames = self.frames.as_mut_view();
        let (encoded, depth) = stack::depth_of(|| entry_encode(encoder, detection, scan_index, frames));
        let Some(encode) = self.clock.instructions().last().copied() else { fail("nothing is counted") };
        if encoded.is_err() {
            fail("there is no room for the scan");
        }
        hprintln!("stage wire {}", encode);
        hprintln!("stack encode {}", depth);
        for frame in &*self.frames {
            send(frame.id(), frame.data());
        }
    }
}

/// What an interface to the bus would do.
fn send(id: StandardId, data: &[u8]) {
    hprint!("can {:03X}#", id.as_raw());
    for byte in data {
        hprint!("{:02X}", byte);
    }
    hprintln!("");
}

/// The entries whose stack is measured and bounded; by name in the image, so that tools find them.
#[unsafe(no_mangle)]
#[inline(never)]
fn entry_configure(detector: &mut RobotDetector, setup: &Setup, backend: Backend) -> Result<(), ConfigError> {
    robot::configure(detector, setup, backend)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn entry_detect(
    detector: &mut RobotDetector,
    pictures: &[Picture<'_>; 2],
    clock: &mut Clock,
) -> Result<(), DetectError> {
    let result = robot::detect(detector, pictures, clock).map(|_| ());
    clock.leave();
    result
}

#[unsafe(no_mangle)]
#[inline(never)]
fn entry_encode(
    encoder: &mut ScanEncoder<RUNS>,
    detection: &RobotDetection,
    scan_index: u16,
    frames: &mut VecView<Frame>,
) -> Result<EncodeReport, OutputFull> {
    robot::encode(encoder, detection, scan_index, frames)
}
