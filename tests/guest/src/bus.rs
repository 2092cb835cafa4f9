//! Ears and a mouth on a CAN bus, apart from the program's own: frames through the `socketcan` crate, scans through the
//! receiver of the core.

use std::{
    fs, io,
    sync::{
        Arc, Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use embedded_can::{Frame as _, Id};
use fencepost_core::{
    health::HealthLevel,
    wire::{Address, HeartbeatRepr, NoScan, Received, ReceiverConfig, ReceiverStatistics, ScanReceiver, WireGround},
};
use fencepost_hal::{can::CanFrame, clock::monotonic_ns};
use socketcan::{CanAnyFrame, CanDataFrame, CanFdFrame, CanFdSocket, CanRemoteFrame, Socket as _, SocketOptions as _};

use crate::machine::wait_for;

/// Most runs of cells in a scan: 255 frames of 8.
const RUNS: usize = 255 * 8;
/// How often the ear looks whether it shall end.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Hears everything on a bus from its making to its end, and takes it apart as a vehicle's controller would.
///
/// Times are those at which the ear took a frame, of the clock of cameras and program: when it is late, then never to the
/// program's advantage.
#[derive(Debug)]
pub struct Listener {
    heard: Arc<Mutex<Heard>>,
    end: Arc<AtomicBool>,
    ear: Option<JoinHandle<()>>,
}

/// What was heard so far.
#[derive(Debug)]
pub struct Heard {
    /// Every frame but error frames, and when it came.
    pub frames: Vec<(u64, CanFrame)>,
    /// What the node said, and when.
    pub words: Vec<(u64, Word)>,
    /// Identifiers of error frames, and when they came.
    pub errors: Vec<(u64, u32)>,
    receiver: Box<ScanReceiver<RUNS>>,
}

/// Something that the node said.
#[derive(Clone, Debug, PartialEq)]
pub enum Word {
    /// A heartbeat.
    Heartbeat(HeartbeatRepr),
    /// A whole scan that may be driven by.
    Scan(HeardScan),
    /// A whole scan that may not.
    Refused(NoScan),
}

/// A whole scan.
#[derive(Clone, Debug, PartialEq)]
pub struct HeardScan {
    /// Index of the scan.
    pub scan_index: u16,
    /// Time since exposure when it was whole, nanoseconds.
    pub age_ns: u64,
    /// How far the cells can be trusted.
    pub health: HealthLevel,
    /// `(i, j, obstacle)` of the known cells.
    pub cells: Vec<(i8, i8, bool)>,
    /// The ground plane.
    pub ground: Option<WireGround>,
}

impl Listener {
    /// Listens to the node with the usual address on `interface`.
    pub fn open(interface: &str) -> Self {
        Self::open_for(interface, Address::default())
    }

    /// Listens to a node on `interface`.
    ///
    /// # Panics
    /// When there is no such interface.
    pub fn open_for(interface: &str, address: Address) -> Self {
        let heard = Arc::new(Mutex::new(Heard {
            frames: Vec::new(),
            words: Vec::new(),
            errors: Vec::new(),
            receiver: Box::new(ScanReceiver::new(ReceiverConfig::new(address))),
        }));
        let end = Arc::new(AtomicBool::new(false));
        // Before the thread begins, so that nothing is missed that is sent from now on.
        let mut socket = open_socket(interface).unwrap_or_else(|error| panic!("{interface}: {error}"));
        let mut number = number_of(interface);
        let (interface, thread_heard, thread_end) = (interface.to_owned(), Arc::clone(&heard), Arc::clone(&end));
        let ear = thread::spawn(move || {
            while !thread_end.load(Ordering::Relaxed) {
                match socket.read_frame() {
                    Ok(frame) => lock(&thread_heard).take(&frame, monotonic_ns()),
                    // An interface that was deleted and made again is another one, of which this socket hears nothing.
                    Err(error)
                        if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
                            && number_of(&interface) == number => {}
                    // Down, or gone: listens again as soon as there is something to listen to.
                    Err(_) => {
                        thread::sleep(LOOK_AGAIN);
                        let found = number_of(&interface);
                        if let Ok(again) = open_socket(&interface) {
                            (socket, number) = (again, found);
                        }
                    }
                }
            }
        });
        Self { heard, end, ear: Some(ear) }
    }

    /// What was heard so far. Nothing is heard while it is held.
    pub fn heard(&self) -> MutexGuard<'_, Heard> {
        lock(&self.heard)
    }

    /// The first word at or after `since_ns` for which `asked` holds: how long after `since_ns` it came. Waits for it, for
    /// `limit` at most.
    pub fn first_word(&self, since_ns: u64, limit: Duration, mut asked: impl FnMut(&Word) -> bool) -> Option<Duration> {
        let at_ns = wait_for(limit, || {
            let heard = self.heard();
            let mut words = heard.words.iter().filter(|(at_ns, _)| *at_ns >= since_ns);
            words.find(|(_, word)| asked(word)).map(|(at_ns, _)| *at_ns)
        });
        at_ns.map(|at_ns| Duration::from_nanos(at_ns - since_ns))
    }

    /// The first heartbeat at or after `since_ns` for which `asked` holds; see [`Listener::first_word`].
    pub fn first_heartbeat(
        &self,
        since_ns: u64,
        limit: Duration,
        asked: impl Fn(&HeartbeatRepr) -> bool,
    ) -> Option<Duration> {
        self.first_word(since_ns, limit, |word| matches!(word, Word::Heartbeat(heartbeat) if asked(heartbeat)))
    }

    /// The first scan at or after `since_ns` for which `asked` holds; see [`Listener::first_word`].
    pub fn first_scan(&self, since_ns: u64, limit: Duration, asked: impl Fn(&HeardScan) -> bool) -> Option<Duration> {
        self.first_word(since_ns, limit, |word| matches!(word, Word::Scan(scan) if asked(scan)))
    }

    /// Waits for `count` frames, for `limit` at most, and returns those that came.
    pub fn frames(&self, count: usize, limit: Duration) -> Vec<CanFrame> {
        wait_for(limit, || (self.heard().frames.len() >= count).then_some(()));
        self.heard().frames.iter().map(|(_, frame)| *frame).collect()
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(ear) = self.ear.take() {
            // What it panicked with was printed already.
            let _ = ear.join();
        }
    }
}

impl Heard {
    /// What the receiver counted.
    pub fn statistics(&self) -> ReceiverStatistics {
        *self.receiver.statistics()
    }

    /// Whole scans that may be driven by.
    pub fn scans(&self) -> impl Iterator<Item = &HeardScan> {
        self.words.iter().filter_map(|(_, word)| if let Word::Scan(scan) = word { Some(scan) } else { None })
    }

    fn take(&mut self, frame: &CanAnyFrame, now_ns: u64) {
        let Some(frame) = from_socket(frame) else {
            return self.errors.push((now_ns, socketcan::Frame::id_word(frame)));
        };
        self.frames.push((now_ns, frame));
        let Id::Standard(id) = frame.id() else { return };
        let received = self.receiver.receive(id, frame.data(), now_ns);
        let word = match received {
            Ok(Received::Heartbeat) => self.receiver.heartbeat(now_ns).map(Word::Heartbeat),
            Ok(Received::Scan { .. }) => Some(self.newest_scan(now_ns)),
            _ => None,
        };
        self.words.extend(word.map(|word| (now_ns, word)));
    }

    fn newest_scan(&self, now_ns: u64) -> Word {
        match self.receiver.scan(now_ns) {
            Ok(scan) => Word::Scan(HeardScan {
                scan_index: scan.scan_index,
                age_ns: scan.age_ns,
                health: scan.health,
                cells: scan.cells().collect(),
                ground: scan.ground,
            }),
            Err(error) => Word::Refused(error),
        }
    }
}

/// A place from which frames are sent.
#[derive(Debug)]
pub struct Speaker {
    socket: CanFdSocket,
}

impl Speaker {
    /// Speaks on `interface`.
    ///
    /// # Panics
    /// When there is no such interface.
    pub fn open(interface: &str) -> Self {
        let socket = CanFdSocket::open(interface).unwrap_or_else(|error| panic!("{interface}: {error}"));
        Self { socket }
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// What the kernel says.
    pub fn send(&self, frame: &CanFrame) -> io::Result<()> {
        self.socket.write_frame(&to_socket(frame))
    }
}

/// Waits until another process listens to everything on `interface`.
///
/// # Panics
/// When none does within seconds.
pub fn wait_for_reader(interface: &str) {
    let found = wait_for(Duration::from_secs(10), || {
        let readers = fs::read_to_string("/proc/net/can/rcvlist_all").unwrap_or_default();
        // The table has a line of its own, `(vcan0: no entry)`, for an interface without.
        readers.lines().any(|line| line.split_whitespace().next() == Some(interface)).then_some(())
    });
    assert!(found.is_some(), "nobody listens on {interface}");
}

/// The kernel's number of an interface, if it is there.
fn number_of(interface: &str) -> Option<String> {
    fs::read_to_string(format!("/sys/class/net/{interface}/ifindex")).ok()
}

fn open_socket(interface: &str) -> io::Result<CanFdSocket> {
    let socket = CanFdSocket::open(interface)?;
    socket.set_error_filter_accept_all()?;
    socket.set_read_timeout(LOOK_AGAIN)?;
    Ok(socket)
}

/// `None` for error frames.
fn from_socket(frame: &CanAnyFrame) -> Option<CanFrame> {
    match frame {
        CanAnyFrame::Normal(frame) => CanFrame::new(frame.id(), frame.data(), false),
        CanAnyFrame::Fd(frame) => {
            Some(CanFrame::new(frame.id(), frame.data(), true)?.with_bit_rate_switch(frame.is_brs()))
        }
        CanAnyFrame::Remote(frame) => embedded_can::Frame::new_remote(frame.id(), frame.dlc()),
        CanAnyFrame::Error(_) => None,
    }
}

fn to_socket(frame: &CanFrame) -> CanAnyFrame {
    let made = if frame.is_remote() {
        CanRemoteFrame::new_remote(frame.id(), frame.dlc()).map(CanAnyFrame::Remote)
    } else if frame.is_fd() {
        CanFdFrame::new(frame.id(), frame.data()).map(|mut fd| {
            fd.set_brs(frame.bit_rate_switch());
            CanAnyFrame::Fd(fd)
        })
    } else {
        CanDataFrame::new(frame.id(), frame.data()).map(CanAnyFrame::Normal)
    };
    made.expect("both sides know the same frames")
}

fn lock(heard: &Mutex<Heard>) -> MutexGuard<'_, Heard> {
    heard.lock().expect("the ear did not panic")
}
