//! CAN interfaces: made, brought up and down, disturbed.

use std::{
    fs,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use fencepost_hal::can::CanFrame;

use crate::{
    bus::{Listener, Speaker},
    machine::{run, try_run, wait_for, write_sys},
    modules::Module,
};

/// A CAN interface that is up until it is dropped.
#[derive(Debug)]
pub struct Interface {
    name: String,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// Made by `ip link add`, and deleted at the end.
    Virtual,
    /// Belongs to a driver; taken down at the end. The driver's folder and what it calls the device.
    Controller { bit_rates: BitRates, driver: PathBuf, device: String },
}

/// Bit rates of a controller, bit/s.
#[derive(Clone, Copy, Debug)]
pub enum BitRates {
    /// Classic CAN.
    Classic(u32),
    /// CAN FD: arbitration, and data where the frame asks for the fast rate.
    Fd(u32, u32),
}

/// Two controllers that are connected with each other, and their driver.
#[derive(Debug)]
pub struct ControllerPair {
    /// The one with the lower number.
    pub a: Interface,
    /// The other one.
    pub b: Interface,
    // After the interfaces: it goes last.
    _driver: Module,
}

impl Interface {
    /// A virtual bus on this machine that carries classic and FD frames.
    pub fn virtual_bus(name: &str) -> Self {
        // With an echo of its own: what is sent then passes the queue, where it can be disturbed, before anyone hears it.
        run("modprobe vcan echo=1");
        let interface = Self { name: name.to_owned(), kind: Kind::Virtual };
        interface.bring_back();
        interface
    }

    /// Sets the bit rates of a driver's interface and brings it up; after bus-off it starts again by itself within 100 ms.
    ///
    /// # Panics
    /// When it has no driver.
    pub fn controller(name: &str, bit_rates: BitRates) -> Self {
        let device = fs::canonicalize(format!("/sys/class/net/{name}/device")).expect("a controller has a device");
        let driver = fs::canonicalize(device.join("driver")).expect("a controller has a driver");
        let device = device.file_name().expect("a device has a name").to_string_lossy().into_owned();
        let interface = Self { name: name.to_owned(), kind: Kind::Controller { bit_rates, driver, device } };
        interface.set_up();
        interface
    }

    /// The interface's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Brings the interface up.
    pub fn up(&self) {
        run(&format!("ip link set {} up", self.name));
    }

    /// Takes the interface down. Whoever sends gets ENETDOWN.
    pub fn down(&self) {
        run(&format!("ip link set {} down", self.name));
    }

    /// Takes the interface away: deletes a virtual bus, unbinds a controller from its driver as if it had been pulled out.
    /// Whoever sends gets ENXIO.
    pub fn take_away(&self) {
        match &self.kind {
            Kind::Virtual => drop(run(&format!("ip link delete {}", self.name))),
            Kind::Controller { driver, device, .. } => write_sys(&driver.join("unbind"), device),
        }
    }

    /// Undoes [`Interface::take_away`].
    ///
    /// # Panics
    /// When the interface does not get its old name.
    pub fn bring_back(&self) {
        match &self.kind {
            Kind::Virtual => drop(run(&format!("ip link add {} type vcan", self.name))),
            Kind::Controller { driver, device, .. } => write_sys(&driver.join("bind"), device),
        }
        assert!(self.is_there(), "{} did not come back by its name", self.name);
        self.set_up();
    }

    /// Disturbs what is sent, by the rules of `tc-netem(8)`: `delay 100ms limit 3`, `loss 10%`, `duplicate 20%`.
    pub fn disturb(&self, rules: &str) {
        run(&format!("tc qdisc replace dev {} root netem {rules}", self.name));
    }

    /// Ends the disturbance, if there is one.
    pub fn undisturb(&self) {
        // Fails where there is none.
        let _ = try_run(&format!("tc qdisc delete dev {} root", self.name));
    }

    fn set_up(&self) {
        match self.kind {
            // The length of a `canfd_frame`: without it the bus would take classic frames only.
            Kind::Virtual => run(&format!("ip link set {} mtu 72", self.name)),
            Kind::Controller { bit_rates: BitRates::Classic(rate), .. } => {
                run(&format!("ip link set {} type can bitrate {rate} restart-ms 100", self.name))
            }
            Kind::Controller { bit_rates: BitRates::Fd(rate, data_rate), .. } => {
                let rates = format!("bitrate {rate} dbitrate {data_rate} fd on");
                run(&format!("ip link set {} type can {rates} restart-ms 100", self.name))
            }
        };
        self.up();
    }

    fn is_there(&self) -> bool {
        Path::new("/sys/class/net").join(&self.name).exists()
    }

    fn put_away(&self) -> Result<(), String> {
        if !self.is_there() {
            return Ok(());
        }
        match self.kind {
            Kind::Virtual => try_run(&format!("ip link delete {}", self.name)).map(drop),
            Kind::Controller { .. } => {
                self.undisturb();
                try_run(&format!("ip link set {} down", self.name)).map(drop)
            }
        }
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        if let Err(error) = self.put_away()
            && !thread::panicking()
        {
            panic!("{error}");
        }
    }
}

impl ControllerPair {
    /// Two classic controllers on one bus, 500 kbit/s.
    ///
    /// The emulated bus takes no time: a frame is in the other controller at once, whose memory holds five. So whoever sends more
    /// at a time has to run on the processor that takes the interrupts ([`on_first_processor`](crate::machine::on_first_processor)),
    /// and the frames are fetched one by one. A remote frame spoils what comes after it.
    pub fn classic() -> Self {
        Self::load("kvaser_pci", BitRates::Classic(500_000))
    }

    /// Two CAN FD controllers on one bus, 500 kbit/s and 2 Mbit/s. Their memories hold a whole scan.
    pub fn fd() -> Self {
        Self::load("ctucanfd_pci", BitRates::Fd(500_000, 2_000_000))
    }

    fn load(driver: &'static str, bit_rates: BitRates) -> Self {
        let module = Module::load(driver, "");
        let mut names = interfaces_of(driver);
        names.sort_unstable();
        let [a, b] = &names[..] else { panic!("{driver} has the interfaces {names:?}; two were expected") };
        let pair =
            Self { a: Interface::controller(a, bit_rates), b: Interface::controller(b, bit_rates), _driver: module };
        pair.flush();
        pair
    }

    /// The emulated controllers keep frames that nobody has fetched, whatever becomes of their driver.
    fn flush(&self) {
        let last: CanFrame = "7FF#FF".parse().expect("a frame");
        for (from, to) in [(&self.a, &self.b), (&self.b, &self.a)] {
            let listener = Listener::open(to.name());
            Speaker::open(from.name()).send(&last).expect("the bus is up");
            let came = wait_for(Duration::from_secs(5), || {
                listener.heard().frames.last().filter(|(_, frame)| *frame == last).map(drop)
            });
            assert!(came.is_some(), "nothing comes from {} to {}", from.name(), to.name());
        }
    }
}

/// Names of the interfaces that a driver has.
fn interfaces_of(driver: &str) -> Vec<String> {
    let entries = fs::read_dir("/sys/class/net").expect("interfaces are listed");
    let names = entries.map(|entry| entry.expect("an interface").file_name().to_string_lossy().into_owned());
    names
        .filter(|name| {
            let link = fs::read_link(format!("/sys/class/net/{name}/device/driver"));
            link.is_ok_and(|link| link.ends_with(driver))
        })
        .collect()
}
