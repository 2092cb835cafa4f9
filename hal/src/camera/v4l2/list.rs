//! The cameras of this machine.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use v4l2r::ioctl::{self, Capability};

use super::device;
use super::offers;
use crate::camera::ListedDevice;

/// The devices of this machine that take pictures, in the order of their numbers, and those that cannot be opened.
pub fn list() -> Vec<ListedDevice> {
    let mut devices: Vec<(u32, PathBuf)> = entries(Path::new("/dev"))
        .into_iter()
        .filter_map(|path| Some((path.file_name()?.to_str()?.strip_prefix("video")?.parse().ok()?, path)))
        .collect();
    devices.sort();
    let links = links();
    devices.into_iter().filter_map(|(_, path)| look_at(path, &links)).collect()
}

/// None for a device that is no camera: one that gives out pictures or makes others of them.
fn look_at(path: PathBuf, links: &[(PathBuf, PathBuf)]) -> Option<ListedDevice> {
    let names = links.iter().filter(|(_, device)| *device == path).map(|(name, _)| name.clone()).collect();
    let mut listed = ListedDevice {
        device: path.clone(),
        names,
        card: String::new(),
        driver: String::new(),
        bus: String::new(),
        formats: Vec::new(),
        controls: Vec::new(),
        problem: None,
    };
    match device::open(&Arc::from(path)) {
        Ok((file, queue)) => {
            if let Ok(capability) = ioctl::querycap::<Capability>(&file) {
                listed.card = capability.card;
                listed.driver = capability.driver;
                listed.bus = capability.bus_info;
            }
            listed.formats = offers::formats(&file, queue);
            listed.controls = offers::controls(&file);
        }
        Err(super::V4l2Error { problem: super::V4l2Problem::NoCamera { .. }, .. }) => return None,
        Err(error) => listed.problem = Some(error.to_string()),
    }
    Some(listed)
}

/// Names below `/dev/v4l`, and those that udev rules of the user's own give directly in `/dev`, with the device that each
/// stands for.
fn links() -> Vec<(PathBuf, PathBuf)> {
    let folders = ["/dev", "/dev/v4l/by-id", "/dev/v4l/by-path"];
    let mut links: Vec<(PathBuf, PathBuf)> = folders
        .iter()
        .flat_map(|folder| entries(Path::new(folder)))
        .filter(|path| path.is_symlink())
        .filter_map(|path| path.canonicalize().ok().map(|device| (path, device)))
        .collect();
    links.sort();
    links
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect()
}
