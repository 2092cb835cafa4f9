//! The report, as text.

use std::fmt::Write;

use crate::{
    bus::{self, BIT_RATES, FD_RATES, SCAN_RATES_HZ},
    figures::{Figures, Panics, Stack},
    instructions::Bound,
    work::StageWork,
};

/// Everything that is known.
pub(crate) fn text(figures: &Figures) -> String {
    let mut text = memory(figures);
    text += &bus(figures);
    text += &work(figures);
    text += &figures.stack.as_ref().map_or_else(
        || "\nSTACK: not looked at; --image takes what bounds/entries/build has linked\n".to_owned(),
        stack,
    );
    text += &figures.instructions.as_deref().map_or_else(
        || "\nINSTRUCTIONS: not looked at; --image takes what bounds/entries/build has linked\n".to_owned(),
        instructions,
    );
    text += &figures.panics.as_ref().map_or_else(
        || "\nPANICS: not looked at; --checked takes what bounds/entries/build has linked\n".to_owned(),
        panics,
    );
    if !figures.faults.is_empty() {
        text += "\nMUST NOT BE\n";
        figures.faults.iter().for_each(|fault| text += &format!("  {fault}\n"));
    }
    text
}

/// Sizes in bytes, and their formulas.
fn memory(figures: &Figures) -> String {
    let mut text = format!("MEMORY, bytes on {}\n{:<18}", std::env::consts::ARCH, "");
    for (name, _) in &figures.layouts {
        write!(text, "{name:>14}").expect("a string takes it");
    }
    text += "   formula\n";
    for (i, formula) in figures.formulas.iter().enumerate() {
        write!(text, "{:<18}", formula.name).expect("a string takes it");
        for (_, layout) in &figures.layouts {
            write!(text, "{:>14}", layout.parts[i].bytes).expect("a string takes it");
        }
        text += &format!("   {formula}\n");
    }
    write!(text, "{:<18}", "whole").expect("a string takes it");
    for (_, layout) in &figures.layouts {
        write!(text, "{:>14}", layout.whole).expect("a string takes it");
    }
    text += "   the sum, and less than 64 of padding\n";
    text += "W, H, D: width, height, disparities; nodes: ((W/8 up)+1) * ((H/8 up)+1); surfaces: 5 for each tile of 32 x 32\n";
    if let Some(bytes) = figures.memory.get("320x240x48.whole_on_thumbv7em") {
        text += &format!("320x240x48 on thumbv7em-none-eabihf: {bytes}\n");
    }
    text
}

/// Bits, loads and times.
fn bus(figures: &Figures) -> String {
    let row = |name: String| figures.bus.get(&name).copied().unwrap_or_default();
    let mut text =
        "\nBUS, with the most stuff bits; load with heartbeats, echoes and the vehicle's motion\n".to_owned();
    for (name, _) in bus::formats() {
        let (frames, bits) = (row(format!("{name}.frames_per_scan")), row(format!("{name}.bits_per_scan")));
        text += &format!("{name}: {frames} frames, {bits} bits a scan\n");
        for kbit in BIT_RATES.map(|rate| rate / 1000) {
            let ms = row(format!("{name}.{kbit}kbit.scan_us")) as f64 / 1000.0;
            text += &format!("  {kbit:>4} kbit/s: a scan is out after {ms:>6.1} ms; load");
            for rate_hz in SCAN_RATES_HZ {
                let percent = row(format!("{name}.{kbit}kbit.{rate_hz}hz.load_permille")) as f64 / 10.0;
                let fits = if percent > 100.0 { " (does not fit)" } else { "" };
                text += &format!("   {rate_hz} Hz {percent:.1} %{fits}");
            }
            text += "\n";
        }
    }
    let ms = row("fd.500kbit_2mbit.scan_us".to_owned()) as f64 / 1000.0;
    let (slow, fast) = FD_RATES;
    text += &format!("  {} kbit/s switched to {} kbit/s: a scan is out after {ms:>6.1} ms\n", slow / 1000, fast / 1000);
    text
}

/// Steps of the loops, and the formulas of the stages.
fn work(figures: &Figures) -> String {
    let mut text = format!("\nWORK, steps of loops with the default settings, at most\n{:<28}", "");
    for (name, _) in &figures.stages {
        write!(text, "{name:>14}").expect("a string takes it");
    }
    text += "   formula\n";
    let Some((_, first)) = figures.stages.first() else { return text };
    let row = |name: &str, steps: &dyn Fn(&[StageWork]) -> u64| {
        let mut row = format!("{name:<28}");
        for (_, stages) in &figures.stages {
            write!(row, "{:>14}", steps(stages)).expect("a string takes it");
        }
        row
    };
    for (i, stage) in first.iter().enumerate() {
        text += &format!("{}   {}\n", row(stage.stage, &|stages| stages[i].total), stage.formula);
        for (j, (name, _)) in stage.loops.iter().enumerate() {
            text += &format!("{}\n", row(&format!("  {name}"), &|stages| stages[i].loops[j].1));
        }
    }
    text += &format!("{}   the sum\n", row("whole", &|stages| stages.iter().map(|stage| stage.total).sum()));
    text
}

/// Depths, the deepest first.
fn stack(stack: &Stack) -> String {
    let mut rows = stack.depths.iter().collect::<Vec<_>>();
    rows.sort_by_key(|(name, bytes)| (std::cmp::Reverse(**bytes), (*name).clone()));
    let mut text = "\nSTACK, bytes on thumbv7em-none-eabihf\n".to_owned();
    rows.iter().for_each(|(name, bytes)| text += &format!("{bytes:>7}  {name}\n"));
    text += "the deepest way, with the bytes of each function:\n";
    stack.deepest.iter().for_each(|(name, bytes)| text += &format!("{bytes:>7}  {name}\n"));
    text
}

/// Instructions for a frame, and what they take where each cycle has one.
fn instructions(bounds: &[Bound]) -> String {
    let (width, height, disparities) = crate::instructions::SIZE;
    let mut text = format!(
        "\nINSTRUCTIONS for a frame of {width} x {height} x {disparities} on a Cortex-M7 with the default settings, at most;\n\
         milliseconds at 480 MHz, if there were one for each cycle\n"
    );
    for Bound { stage, instructions, loops, .. } in bounds {
        let ms = *instructions as f64 / 480.0e3;
        text += &format!("{instructions:>12}  {ms:>7.1} ms  {stage}, in {loops} loops of its machine code\n");
    }
    let stages = crate::work::Shape::of(width, height, disparities).stages();
    let missing = stages.iter().filter(|work| bounds.iter().all(|bound| bound.stage != work.stage));
    missing.for_each(|work| text += &format!("{:>12}  {:>7}     {}\n", "none", "", work.stage));
    text
}

/// Calls of panics, by function.
fn panics(panics: &Panics) -> String {
    let calls: usize = panics.calls.iter().map(|(_, count)| count).sum();
    let mut text =
        format!("\nPANICS with all checks of arithmetic: {calls} calls, from {} entries\n", panics.entries.len());
    panics.calls.iter().for_each(|(name, count)| text += &format!("{count:>7}  {name}\n"));
    text
}
