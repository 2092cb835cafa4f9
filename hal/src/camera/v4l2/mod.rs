//! Cameras of Linux, by V4L2: two devices, or one that delivers both pictures in one.
//!
//! Pictures are taken from buffers that driver and program share: those that are grey already are lent as they lie there,
//! the others are unpacked once. After the start nothing is allocated, except by the decoder of JPEG.
//!
//! A device that goes (unplugged, or its driver gave up) is an error of kind [`Lost`](CameraErrorKind::Lost); every further
//! call tries to open it again, with the same settings.

mod device;
mod error;
mod list;
mod offers;
mod open;
mod setup;
mod times;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

pub use error::{V4l2Error, V4l2Problem};
pub use list::list;

use super::pairing::{Paired, Pairing, PairingCounts, Side};
use super::{
    Camera, CameraDevices, CameraError, CameraErrorKind, CameraSettings, CameraSettingsError, PackedLayout,
    PixelFormat, StereoPair,
};
use crate::clock::monotonic_ns;
use device::Frame;
use open::{Lens, Open};
use times::OddTimes;

/// Time between two attempts to open a device that is gone, nanoseconds.
const RETRY_NS: u64 = 100_000_000;

/// Attempts that follow each other so soon; afterwards the time between two doubles, up to [`LONGEST_RETRY_NS`].
const QUICK_RETRIES: u32 = 5;

/// A device that could be opened in vain over and over is left alone for so long, nanoseconds.
const LONGEST_RETRY_NS: u64 = 1_000_000_000;

/// A device that delivers nothing for so long is opened again: some come to life by that. Nanoseconds.
const STALL_NS: u64 = 2_000_000_000;

/// More warnings than this are not kept for somebody who does not ask.
const MOST_WARNINGS: usize = 32;

/// A pair of cameras that delivers pairs of pictures.
pub struct V4l2Camera {
    settings: CameraSettings,
    left: Arc<Path>,
    right: Arc<Path>,
    layout: Option<PackedLayout>,
    /// None while a device is gone.
    open: Option<Open>,
    opened_before: bool,
    retry_ns: u64,
    /// Times that the devices were opened, or one of them, without a pair of pictures since.
    in_vain: u32,
    /// Since when the next pair is waited for.
    waiting_since_ns: Option<u64>,
    pairing: Pairing<Frame>,
    said: PairingCounts,
    /// Of which device it was said that its times are odd.
    said_times: [bool; 2],
    warnings: Vec<String>,
}

impl V4l2Camera {
    /// Opens the devices, so that they stream.
    ///
    /// # Errors
    /// When a setting cannot be used, or a device is not there, is used by another program, may not be opened, or cannot
    /// deliver what the settings say.
    pub fn open(settings: &CameraSettings) -> Result<Self, V4l2Error> {
        let mut camera = Self::closed(settings)?;
        camera.reopen()?;
        Ok(camera)
    }

    /// As [`V4l2Camera::open`], but the devices are opened by the first call for a pair: for those that may be plugged in
    /// later.
    ///
    /// # Errors
    /// When a setting cannot be used.
    pub fn closed(settings: &CameraSettings) -> Result<Self, V4l2Error> {
        let unusable = |error: CameraSettingsError| {
            let device = settings.left.as_deref().or(settings.device.as_deref()).unwrap_or(Path::new("camera"));
            V4l2Error::new(&Arc::from(device), V4l2Problem::Setting(error))
        };
        settings.check().map_err(unusable)?;
        let (left, right, layout) = match settings.devices().map_err(unusable)? {
            CameraDevices::Two { left, right } => (Arc::from(left), Arc::from(right), None),
            CameraDevices::One { device, layout } => (Arc::from(device), Arc::from(device), Some(layout)),
        };
        Ok(Self {
            left,
            right,
            layout,
            open: None,
            opened_before: false,
            retry_ns: 0,
            in_vain: 0,
            waiting_since_ns: None,
            pairing: Pairing::new(settings.pairing_tolerance_ns()),
            said: PairingCounts::default(),
            said_times: [false; 2],
            warnings: Vec::new(),
            settings: settings.clone(),
        })
    }

    /// Whether the devices are open.
    pub const fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// The format of the left and of the right pictures, while the devices are open.
    pub fn formats(&self) -> Option<(PixelFormat, PixelFormat)> {
        let open = self.open.as_ref()?;
        let format = |lens: &Lens| lens.device.pictures.format;
        Some((format(&open.left), format(open.right.as_ref().unwrap_or(&open.left))))
    }

    /// What was odd about the pictures since the start.
    pub const fn counts(&self) -> PairingCounts {
        self.pairing.counts()
    }

    /// What was odd since the last call: settings that could not be set, times that jumped.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// The devices, opened again where they are gone. Waits until it is time to try.
    fn reopen(&mut self) -> Result<&mut Open, V4l2Error> {
        if self.open.is_none() {
            let mut warnings = Vec::new();
            let opened = Open::new(&self.settings, [&self.left, &self.right], self.layout, &mut warnings);
            // To find that a device is not there costs nothing and disturbs nobody.
            self.in_vain = match &opened {
                Err(error) if matches!(error.problem, V4l2Problem::Absent) => 0,
                _ => self.in_vain.saturating_add(1),
            };
            self.retry_ns = monotonic_ns().saturating_add(retry_ns(self.in_vain));
            let open = opened.map_err(|error| if self.opened_before { still_lost(error) } else { error })?;
            // What cannot be set was said the first time.
            if !std::mem::replace(&mut self.opened_before, true) {
                self.warnings.append(&mut warnings);
            }
            self.open = Some(open);
        }
        self.open.as_mut().ok_or_else(|| V4l2Error::new(&self.left, V4l2Problem::NotBack))
    }

    /// Until when the next pair must have come: counted from the pair before, whatever the caller did with it meanwhile. Those
    /// that have come in that time are taken nevertheless.
    fn deadline_ns(&self) -> u64 {
        const LEAST_NS: u64 = 5_000_000;
        let now_ns = monotonic_ns();
        let timeout_ns = 1_000_000 * u64::from(self.settings.timeout_ms());
        let since_ns = self.waiting_since_ns.unwrap_or(now_ns);
        since_ns.saturating_add(timeout_ns).max(now_ns.saturating_add(LEAST_NS.min(timeout_ns)))
    }

    /// Opens the devices if they are closed, no sooner than is sensible and no later than `deadline_ns`.
    fn ready(&mut self, deadline_ns: u64) -> Result<(), V4l2Error> {
        let now_ns = monotonic_ns();
        if self.open.is_none() && now_ns < self.retry_ns {
            let until_ns = self.retry_ns.min(deadline_ns);
            std::thread::sleep(Duration::from_nanos(until_ns.saturating_sub(now_ns)));
            if until_ns < self.retry_ns {
                return Err(V4l2Error::new(&self.left, V4l2Problem::NotBack));
            }
        }
        self.reopen().map(|_| ())
    }

    /// Closes the devices; the next call opens them again.
    fn close(&mut self) {
        self.pairing.restart(|_, _| ());
        self.open = None;
    }

    /// Makes a call ready whose caller may have been away.
    ///
    /// What arrived meanwhile cannot be given its time where that is the time of arrival: it would seem newer than it is. Such
    /// pictures are passed over, except where every pair is wanted.
    fn begin(&mut self) -> Result<(), V4l2Error> {
        match &mut self.open {
            Some(open) if self.settings.newest_only => {
                let away_ns = self.waiting_since_ns.map_or(0, |since_ns| monotonic_ns().saturating_sub(since_ns));
                // One of the buffers is lent.
                self.pairing.away(away_ns, self.settings.buffers.saturating_sub(1));
                open.pass_over_waiting(&mut self.pairing)
            }
            _ => Ok(()),
        }
    }

    /// Takes pictures until two of them are a pair.
    ///
    /// # Bound
    /// Until `deadline_ns`, and no more pictures than the devices deliver until then.
    fn wait_for_pair(&mut self, deadline_ns: u64) -> Result<Paired<Frame>, V4l2Error> {
        let timeout_ms = self.settings.timeout_ms();
        let mut came = [false; 2];
        loop {
            let Some(open) = &mut self.open else {
                return Err(V4l2Error::new(&self.left, V4l2Problem::NotBack));
            };
            // A picture whose time is that of its arrival is taken over when it arrives, whichever side is due.
            let either = open.by_arrival();
            let mut side = self.pairing.wanted();
            let mut attempt = open.take(side, &mut self.pairing, self.settings.newest_only)?;
            if either && !attempt.taken && open.right.is_some() {
                let other = side.other();
                attempt = open.take(other, &mut self.pairing, self.settings.newest_only)?;
                side = if attempt.taken { other } else { side };
            }
            if let Some(pair) = attempt.pair {
                return Ok(pair);
            }
            if attempt.taken {
                came[usize::from(side == Side::Right)] = true;
            }
            // A device that delivers pictures without partners must not hold the caller up.
            let goes_on = match attempt.taken {
                true => monotonic_ns() < deadline_ns,
                false => open.wait(side, either, deadline_ns)?,
            };
            if goes_on {
                continue;
            }
            let problem = match came {
                [true, true] => V4l2Problem::NoPartner { timeout_ms },
                _ => V4l2Problem::NoPicture { timeout_ms },
            };
            let late = open.lens(side);
            let error = V4l2Error::new(&late.device.path, problem);
            if monotonic_ns().saturating_sub(late.device.alive_ns) > STALL_NS.max(20_000_000 * u64::from(timeout_ms)) {
                self.close();
                return Err(error);
            }
            // A picture that has waited so long would only be old.
            let mut waited = [None, None];
            self.pairing.release(|side, frame| waited[usize::from(side == Side::Right)] = Some((side, frame)));
            open.put_back(waited)?;
            return Err(error);
        }
    }

    /// Says once what is odd about the pictures.
    fn say(&mut self) {
        if let Some(open) = &self.open {
            let devices = [Some(&open.left.device), open.right.as_ref().map(|right| &right.device)];
            for (device, said) in devices.into_iter().flatten().zip(&mut self.said_times) {
                // Memory is taken for the first one only.
                if let Some(odd) = device.times.odd()
                    && !std::mem::replace(said, true)
                {
                    self.warnings.push(odd_times(&device.path, odd));
                }
            }
        }
        let counts = self.pairing.counts();
        let odd = [
            (
                counts.jumps,
                &mut self.said.jumps,
                "times of exposure have jumped; pictures from before and after are never paired",
            ),
            (
                counts.restarts,
                &mut self.said.restarts,
                "the numbers of the pictures have begun anew; pictures lost meanwhile cannot be counted",
            ),
            (
                counts.apart,
                &mut self.said.apart,
                "their times of exposure are more than a second apart: their clocks do not agree, no pair can be made of them",
            ),
        ];
        for (count, said, what) in odd {
            // Memory is taken for the first one of a kind only.
            if count > 0 && *said == 0 && self.warnings.len() < MOST_WARNINGS {
                self.warnings.push(format!("{} and {}: {what}", self.left.display(), self.right.display()));
            }
            *said = count;
        }
    }
}

impl Camera for V4l2Camera {
    type Error = V4l2Error;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let deadline_ns = self.deadline_ns();
        self.ready(deadline_ns)?;
        let begun = self.begin();
        let pair = begun.and_then(|()| self.wait_for_pair(deadline_ns));
        self.waiting_since_ns = Some(monotonic_ns());
        let result = pair.and_then(|pair| {
            let not_back = || V4l2Error::new(&self.left, V4l2Problem::NotBack);
            let open = self.open.as_mut().ok_or_else(not_back)?;
            let result = open.lend(&pair, self.layout, consume);
            if result.is_err() {
                self.pairing.spoilt(&pair);
            }
            self.in_vain = if result.is_ok() { 0 } else { self.in_vain };
            // A pair that was seen is a success; if a buffer is not taken back, the next call finds out why.
            match open.put_back(pair_frames(&pair, self.layout)) {
                Err(error) if result.is_err() => Err(error),
                _ => result,
            }
        });
        self.say();
        if result.as_ref().is_err_and(|error| error.kind() == CameraErrorKind::Lost) {
            self.close();
        }
        result.map(Some)
    }

    fn take_warning(&mut self) -> Option<String> {
        (!self.warnings.is_empty()).then(|| self.warnings.remove(0))
    }
}

impl std::fmt::Debug for V4l2Camera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("V4l2Camera").field("settings", &self.settings).field("is_open", &self.is_open()).finish()
    }
}

/// Time until the next attempt, after so many in vain.
fn retry_ns(in_vain: u32) -> u64 {
    let doublings = in_vain.saturating_sub(QUICK_RETRIES).min(8);
    (RETRY_NS << doublings).min(LONGEST_RETRY_NS)
}

fn odd_times(device: &Path, odd: OddTimes) -> String {
    format!(
        "{}: {}; the time when a picture arrives stands in, so that the pairing of left and right and the age of the cells are \
         less exact",
        device.display(),
        odd.what()
    )
}

/// The buffers of a pair: one where both pictures lie in it.
fn pair_frames(pair: &Paired<Frame>, layout: Option<PackedLayout>) -> [Option<(Side, Frame)>; 2] {
    let right = layout.is_none().then_some((Side::Right, pair.right));
    [Some((Side::Left, pair.left)), right]
}

/// A device that worked before and now cannot is not yet as it was: it is tried again.
fn still_lost(error: V4l2Error) -> V4l2Error {
    if error.kind() == CameraErrorKind::Lost {
        return error;
    }
    let text = std::io::Error::other(error.to_string());
    V4l2Error::setup(&error.device, "open", text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_cannot_be_used_are_told_before_anything_is_opened() {
        let same = CameraSettings::two("/dev/video0", "/dev/video0", 640, 480);
        let error = V4l2Camera::open(&same).unwrap_err();
        assert_eq!(error.kind(), CameraErrorKind::Unusable);
        assert!(error.to_string().starts_with("camera.right: is the same device"), "{error}");
    }

    #[test]
    fn a_device_that_is_not_there_is_tried_again_and_never_waited_for_longer_than_the_time_out() {
        let settings =
            CameraSettings { timeout_ms: Some(20), ..CameraSettings::two("/nowhere/left", "/nowhere/right", 640, 480) };
        assert_eq!(V4l2Camera::open(&settings).unwrap_err().kind(), CameraErrorKind::Lost);
        let mut camera = V4l2Camera::closed(&settings).unwrap();
        let mut tried = 0;
        for call in 0..12 {
            let error = camera.next_pair(|_| ()).unwrap_err();
            assert_eq!(error.kind(), CameraErrorKind::Lost);
            match error.problem {
                V4l2Problem::Absent => tried += 1,
                V4l2Problem::NotBack => assert!(call > 0),
                problem => panic!("{problem:?}"),
            }
        }
        // Five calls of 20 ms fill the time between two attempts.
        assert!((1..=4).contains(&tried), "tried {tried} times in twelve calls");
        assert!(!camera.is_open() && camera.formats().is_none());
    }

    #[test]
    fn while_one_device_is_away_the_other_is_not_opened() {
        // The one that is there would say that it is no camera, once it is opened.
        for (left, right) in [("/dev/null", "/nowhere/right"), ("/nowhere/left", "/dev/null")] {
            let error = V4l2Camera::open(&CameraSettings::two(left, right, 640, 480)).unwrap_err();
            assert!(matches!(error.problem, V4l2Problem::Absent), "{error}");
            assert!(error.device.starts_with("/nowhere"), "{error}");
        }
    }

    #[test]
    fn a_device_that_is_opened_in_vain_is_left_alone_for_longer_and_longer_up_to_a_second() {
        let waits: Vec<u64> = (1..12).map(|in_vain| retry_ns(in_vain) / 1_000_000).collect();
        assert_eq!(waits, [100, 100, 100, 100, 100, 200, 400, 800, 1000, 1000, 1000]);
        assert_eq!(retry_ns(u32::MAX), LONGEST_RETRY_NS);
    }

    #[test]
    fn a_file_that_is_no_camera_is_said_to_be_none() {
        let error = V4l2Camera::open(&CameraSettings::two("/dev/null", "/dev/zero", 640, 480)).unwrap_err();
        assert_eq!(error.kind(), CameraErrorKind::Unusable);
        assert!(error.to_string().contains("takes no pictures"), "{error}");
    }

    #[test]
    fn what_worked_before_is_tried_again_whatever_the_error() {
        let device: Arc<Path> = Path::new("/dev/video0").into();
        let unusable = V4l2Error::new(&device, V4l2Problem::NoCamera { card: "codec".into() });
        let lost = still_lost(unusable);
        assert_eq!(lost.kind(), CameraErrorKind::Lost);
        assert!(lost.to_string().contains("codec"), "{lost}");
    }
}
