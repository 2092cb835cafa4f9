//! The program as a service: what systemd is told, and what the kernel grants.

use std::{fs, os::unix::net::UnixDatagram, time::Duration};

use fencepost_guest_tests::{bus::Listener, net::Interface, program::Program, say};
use fencepost_hal::clock::monotonic_ns;
use rustix::process::Signal;

use super::{PATIENCE, recorded_rig, start, trail, wait_for_heartbeat, wait_until_healthy};

const SETTINGS: &str = "[run]\ndeadline_ms = 10000\nstale_ms = 10000\npriority = 0\n";
/// Time after which systemd would take the program for hung.
const WATCHDOG: Duration = Duration::from_secs(5);

/// What a program tells systemd.
struct Systemd {
    socket: UnixDatagram,
    path: &'static str,
}

impl Systemd {
    fn open() -> Self {
        let path = "/tmp/notify";
        // Left over from a test before.
        let _ = fs::remove_file(path);
        let socket = UnixDatagram::bind(path).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        Self { socket, path }
    }

    fn start(&self, rig: &str) -> Program {
        let watchdog_us = WATCHDOG.as_micros().to_string();
        let environment = [("NOTIFY_SOCKET", self.path), ("WATCHDOG_USEC", watchdog_us.as_str())];
        Program::start_with_env(&format!("run --config {rig} -v"), &environment)
    }

    /// How long until a message has the line `wanted`.
    fn wait_for(&self, wanted: &str, program: &Program, limit: Duration) -> Duration {
        let start_ns = monotonic_ns();
        let mut heard = String::new();
        loop {
            let mut message = [0; 4096];
            if let Ok(length) = self.socket.recv(&mut message) {
                let message = String::from_utf8_lossy(&message[..length]);
                if message.lines().any(|line| line == wanted) {
                    return Duration::from_nanos(monotonic_ns() - start_ns);
                }
                heard += &message;
            }
            let waited = Duration::from_nanos(monotonic_ns() - start_ns);
            assert!(waited < limit, "no {wanted} within {limit:?}, only:\n{heard}\n{}", program.said());
        }
    }

    /// Signs of life as often as systemd wants them, `count` of them.
    fn assert_alive(&self, program: &Program, count: u32) {
        let longest = (0..count).map(|_| self.wait_for("WATCHDOG=1", program, WATCHDOG)).max();
        say!("{count} signs of life, {} ms apart at most", longest.unwrap_or_default().as_millis());
    }
}

#[test]
fn systemd_is_told_of_the_start_of_life_and_of_the_end() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let systemd = Systemd::open();
    let program = systemd.start(&recorded_rig(bus.name(), SETTINGS, true));
    systemd.wait_for("READY=1", &program, PATIENCE);
    systemd.assert_alive(&program, 4);
    wait_until_healthy(&listener, &program, 0);
    program.signal(Signal::TERM);
    systemd.wait_for("STOPPING=1", &program, PATIENCE);
    assert!(program.wait(PATIENCE).status.success());
}

/// One of the two is always at work: that the other has not moved since the last look is no sign of death.
#[test]
fn two_slow_pairs_in_turn_are_alive() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let systemd = Systemd::open();
    let pairs: String = [("front", 0), ("rear", 180)]
        .map(|(name, yaw_deg)| {
            let path = trail();
            let recording = format!("path = \"{}\"\nrepeat = true\nrate_hz = 5.0\n", path.display());
            let mount = format!("height_m = 1.1\npitch_down_deg = 10.0\nyaw_left_deg = {yaw_deg}\n");
            format!("[[pair]]\nname = \"{name}\"\n[pair.mount]\n{mount}[pair.recording]\n{recording}")
        })
        .concat();
    let rig = "/tmp/two_pairs.toml";
    fs::write(rig, format!("[bus]\ninterface = \"{}\"\n{SETTINGS}{pairs}", bus.name())).unwrap();
    let program = systemd.start(rig);
    systemd.wait_for("READY=1", &program, PATIENCE);
    wait_for_heartbeat(&listener, &program, "a scan", 0, |heartbeat| heartbeat.last_scan.is_some());
    systemd.assert_alive(&program, 8);
    program.stop(PATIENCE);
}

/// Fields of `/proc/PID/task/TID/stat`, see proc_pid_stat(5); `SCHED_FIFO` is 1 in `linux/sched.h`.
#[test]
fn the_loop_has_real_time_priority_and_memory_that_stays() {
    const SCHED_FIFO: u32 = 1;
    let settings = "[run]\ndeadline_ms = 10000\nstale_ms = 10000\npriority = 50\nlock_memory = true\nhold_ms = 100\n";
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name(), settings, true));
    wait_until_healthy(&listener, &program, 0);
    let tasks = fs::read_dir(format!("/proc/{}/task", program.pid())).unwrap();
    let mut urgent: Vec<(u32, u32)> = tasks
        .map(|task| {
            let stat = fs::read_to_string(task.unwrap().path().join("stat")).unwrap();
            // The name of the thread, field 2, may have blanks: fields are counted from behind it.
            let (_, fields) = stat.rsplit_once(") ").unwrap();
            let field = |number: usize| fields.split_whitespace().nth(number - 3).unwrap().parse::<u32>().unwrap();
            (field(41), field(40))
        })
        .filter(|(policy, _)| *policy != 0)
        .collect();
    urgent.sort_unstable();
    // One thread for the pair, one above it for the bus; who speaks to people waits.
    assert_eq!(urgent, [(SCHED_FIFO, 50), (SCHED_FIFO, 51)]);
    let status = fs::read_to_string(format!("/proc/{}/status", program.pid())).unwrap();
    let locked = status.lines().find_map(|line| line.strip_prefix("VmLck:")).unwrap();
    let locked_kib: u64 = locked.split_whitespace().next().unwrap().parse().unwrap();
    say!("{locked_kib} KiB are locked");
    assert!(locked_kib > 0);
    program.stop(PATIENCE);
}
