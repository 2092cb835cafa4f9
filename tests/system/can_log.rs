//! What went on the bus is what the tables say, read by a decoder that is not ours.

use std::path::Path;

use fencepost_tests::{
    at_hand::{self, RECORDINGS, ROOT},
    say,
};

#[test]
fn every_frame_of_every_recording_decodes_to_its_cells() {
    let Some(python) = at_hand::python() else { return };
    let checker = Path::new(ROOT).join("tests/python/check_can_log.py");
    for name in RECORDINGS {
        let Some(out) = super::replayed(name) else { continue };
        let (log, cells) = (out.join("can.log"), out.join("cells.csv"));
        let said = at_hand::run_python(&python, &checker, &[log.as_ref(), cells.as_ref()]);
        let scans = said.rsplit_once("can.log: ").and_then(|(_, rest)| rest.split(" agree").next());
        say!("{name}: {} agree with cells.csv", scans.unwrap_or(&said));
    }
}
