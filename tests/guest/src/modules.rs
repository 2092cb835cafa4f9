//! Kernel modules.

use std::thread;

use crate::machine::{run, try_run};

/// A kernel module that is unloaded again at the end of a test, so that the next test finds its devices as new.
#[derive(Debug)]
pub struct Module {
    name: &'static str,
}

impl Module {
    /// Loads a module and those that it needs. `parameters` are words `name=value`.
    ///
    /// # Panics
    /// When it cannot be loaded.
    pub fn load(name: &'static str, parameters: &str) -> Self {
        run(&format!("modprobe {name} {parameters}"));
        Self { name }
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        let unloaded = try_run(&format!("modprobe -r {}", self.name));
        if let Err(error) = unloaded
            && !thread::panicking()
        {
            panic!("{error}");
        }
    }
}
