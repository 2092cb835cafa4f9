//! The program, run as a user would run it.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::PathBuf,
    process::{Child, Command, ExitStatus, Stdio},
    sync::{Arc, Mutex, OnceLock},
    thread::{self, JoinHandle},
    time::Duration,
};

use rustix::process::{Pid, Signal, kill_process};

use crate::{
    machine::{assert_guest, wait_for},
    resources::Resources,
};

/// A running program. Killed when dropped.
#[derive(Debug)]
pub struct Program {
    child: Child,
    said: Arc<Mutex<String>>,
    ears: Vec<JoinHandle<()>>,
}

/// How a program ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// Its status.
    pub status: ExitStatus,
    /// Everything that it printed.
    pub said: String,
}

impl Program {
    /// Starts `fencepost` with arguments, separated by blanks.
    ///
    /// # Panics
    /// When it cannot be started.
    pub fn start(arguments: &str) -> Self {
        Self::start_with_env(arguments, &[])
    }

    /// As [`Program::start`], with names and values added to the environment.
    ///
    /// # Panics
    /// When it cannot be started.
    pub fn start_with_env(arguments: &str, environment: &[(&str, &str)]) -> Self {
        assert_guest();
        let mut command = Command::new(program());
        command.envs(environment.iter().copied());
        command.args(arguments.split_whitespace()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap_or_else(|error| panic!("fencepost cannot be started: {error}"));
        let said = Arc::new(Mutex::new(String::new()));
        let stdout = child.stdout.take().map(|stdout| listen(stdout, Arc::clone(&said)));
        let stderr = child.stderr.take().map(|stderr| listen(stderr, Arc::clone(&said)));
        Self { child, said, ears: stdout.into_iter().chain(stderr).collect() }
    }

    /// Number of the process.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// What it printed so far.
    ///
    /// # Panics
    /// Never: who listens to it does not panic.
    pub fn said(&self) -> String {
        self.said.lock().expect("the listener did not panic").clone()
    }

    /// What it holds now.
    pub fn resources(&self) -> Resources {
        Resources::of(self.pid())
    }

    /// Whether it still runs.
    ///
    /// # Panics
    /// When that cannot be known.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().expect("the state of a child is known").is_none()
    }

    /// Asks it to end (SIGTERM) and waits until it has, for `limit` at most.
    ///
    /// # Panics
    /// When it does not.
    pub fn stop(self, limit: Duration) -> Ended {
        self.signal(Signal::TERM);
        self.wait(limit)
    }

    /// Sends a signal.
    ///
    /// # Panics
    /// When there is nobody to take it.
    pub fn signal(&self, signal: Signal) {
        let pid = i32::try_from(self.pid()).ok().and_then(Pid::from_raw).expect("a process has a number");
        kill_process(pid, signal).unwrap_or_else(|error| panic!("{signal:?} to fencepost: {error}; {}", self.said()));
    }

    /// Waits until it has ended by itself, for `limit` at most.
    ///
    /// # Panics
    /// When it does not end.
    pub fn wait(mut self, limit: Duration) -> Ended {
        let status = wait_for(limit, || self.child.try_wait().expect("the state of a child is known"));
        let Some(status) = status else { panic!("fencepost did not end within {limit:?}; it said:\n{}", self.said()) };
        for ear in self.ears.drain(..) {
            // What it panicked with was printed already.
            let _ = ear.join();
        }
        Ended { status, said: self.said() }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It may have ended long ago.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The program in the guest's own memory: read over a shared folder while it runs, it would be late for no fault of its own.
fn program() -> &'static PathBuf {
    static COPY: OnceLock<PathBuf> = OnceLock::new();
    COPY.get_or_init(|| {
        let original = std::env::var_os("FENCEPOST_PROGRAM").expect("FENCEPOST_PROGRAM is set by tests/guest/run");
        let copy = PathBuf::from("/tmp/fencepost");
        fs::copy(&original, &copy).unwrap_or_else(|error| panic!("{}: {error}", original.display()));
        copy
    })
}

fn listen(pipe: impl std::io::Read + Send + 'static, said: Arc<Mutex<String>>) -> JoinHandle<()> {
    thread::spawn(move || {
        for line in BufReader::new(pipe).lines().map_while(Result::ok) {
            let mut said = said.lock().expect("whoever asks does not panic while asking");
            said.push_str(&line);
            said.push('\n');
        }
    })
}
