// SPDX-License-Identifier: GPL-2.0-or-later
//! The confinement of a run. A program can run Python and a HAL file is Tcl, so that only the kernel can enforce it.
//!
//! Landlock decides which files are read, written and executed; a filter of system calls (seccomp) decides the rest.
//! Both bind a thread and the processes that it starts, and cannot be removed.

use crate::refusal::NotJudged;
use landlock::{
    ABI, Access, AccessFs, BitFlags, Ruleset, RulesetAttr, RulesetCreatedAttr, RulesetStatus,
    make_bitflags, path_beneath_rules,
};
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
    SeccompRule, apply_filter,
};
use std::collections::BTreeMap;
use std::env::consts::ARCH;
use std::error::Error;
use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};
use std::thread;

/// The newest Landlock ABI whose rights are listed here. Under an older one the filter of system calls closes the gaps.
const LANDLOCK: ABI = ABI::V5;

/// Readable files and folders of the system. They contain no programs.
const SYSTEM: [&str; 12] = [
    "/lib",
    "/lib64",
    "/usr/lib",
    "/usr/lib64",
    "/usr/local/lib",
    "/usr/share",
    "/etc/ld.so.cache",
    "/etc/localtime",
    "/etc/nsswitch.conf",
    "/etc/passwd",
    "/dev/null",
    "/dev/urandom",
];

/// The program loaders, which the kernel starts with each program; a processor has one of them.
const LOADERS: [&str; 2] = ["/lib64/ld-linux-x86-64.so.2", "/lib/ld-linux-aarch64.so.1"];

/// Rights of a process in the folder of its run: it creates only regular files, because they are copied afterwards.
const WRITES: BitFlags<AccessFs> =
    make_bitflags!(AccessFs::{ReadFile | ReadDir | WriteFile | RemoveFile | MakeReg | Truncate});

/// The file access of a run.
#[derive(Debug)]
pub struct Rights {
    /// Readable files and folders.
    pub reads: Vec<PathBuf>,
    /// Writable folder.
    pub writes: PathBuf,
    pub starts: Vec<PathBuf>,
}

/// The thread that gives the processes of a run its rights. The kernel may end them with it.
pub struct Keeper {
    _ended: Sender<()>,
}

/// Starts processes with these rights, or without `rights` with those of the user.
///
/// # Errors
/// The kernel enforces no such rights, or what `start` returns.
pub fn start<T: Send + 'static>(
    rights: Option<Rights>,
    start: impl FnOnce() -> Result<T, NotJudged> + Send + 'static,
) -> Result<(T, Keeper), NotJudged> {
    let (_ended, wait) = channel::<()>();
    let (send, started) = channel();
    thread::spawn(move || {
        let enforced = rights.map_or(Ok(()), |rights| rights.enforce());
        let enforced = enforced.map_err(|error| NotJudged::Unconfined(error.to_string()));
        // Nothing receives if the caller has panicked.
        let _ = send.send(enforced.and_then(|()| start()));
        let _ = wait.recv();
    });
    let started = started.recv().expect("the thread sends a result")?;
    Ok((started, Keeper { _ended }))
}

impl Rights {
    /// Confines this thread.
    fn enforce(&self) -> Result<(), Box<dyn Error>> {
        let reads = AccessFs::ReadFile | AccessFs::ReadDir;
        let starts = AccessFs::ReadFile | AccessFs::Execute;
        let status = Ruleset::default()
            .handle_access(AccessFs::from_all(LANDLOCK))?
            .create()?
            .add_rules(path_beneath_rules(SYSTEM, reads))?
            .add_rules(path_beneath_rules(&self.reads, reads))?
            .add_rules(path_beneath_rules(["/dev/null"], reads | AccessFs::WriteFile))?
            .add_rules(path_beneath_rules([&self.writes], WRITES))?
            .add_rules(path_beneath_rules(LOADERS, starts))?
            .add_rules(path_beneath_rules(&self.starts, starts))?
            .restrict_self()?;
        if status.ruleset == RulesetStatus::NotEnforced {
            return Err("it has no Landlock".into());
        }
        let filter: BpfProgram = filter()?.try_into()?;
        Ok(apply_filter(&filter)?)
    }
}

/// Returns whether an argument of a system call, in the bits of `mask`, has a value.
fn argument(number: u8, mask: libc::c_int, value: libc::c_int) -> Condition {
    let (mask, value) = (u64::from(mask.cast_unsigned()), u64::from(value.cast_unsigned()));
    SeccompCondition::new(number, SeccompCmpArgLen::Dword, SeccompCmpOp::MaskedEq(mask), value)
}

type Condition = Result<SeccompCondition, seccompiler::BackendError>;

/// Returns whether one of the conditions is met.
fn any(
    conditions: impl IntoIterator<Item = Condition>,
) -> Result<Vec<SeccompRule>, seccompiler::BackendError> {
    conditions.into_iter().map(|condition| SeccompRule::new(vec![condition?])).collect()
}

/// The system calls that are allowed. A list of the forbidden ones would miss those of later kernels.
fn filter() -> Result<SeccompFilter, seccompiler::BackendError> {
    let mut rules: BTreeMap<i64, Vec<SeccompRule>> =
        CALLS.iter().chain(OLD_CALLS).map(|call| (*call, vec![])).collect();
    // Landlock before Linux 6.2 allows truncating a file that is opened for reading.
    let opens = |flags: u8| {
        any([
            argument(flags, libc::O_ACCMODE, libc::O_WRONLY),
            argument(flags, libc::O_ACCMODE, libc::O_RDWR),
            argument(flags, libc::O_TRUNC, 0),
        ])
    };
    rules.insert(libc::SYS_openat, opens(2)?);
    #[cfg(target_arch = "x86_64")]
    rules.insert(libc::SYS_open, opens(1)?);
    // No F_SETOWN or F_SETSIG, which send signals to other processes.
    let uses = [
        libc::F_DUPFD,
        libc::F_DUPFD_CLOEXEC,
        libc::F_GETFD,
        libc::F_SETFD,
        libc::F_GETFL,
        libc::F_SETFL,
        libc::F_GETLK,
        libc::F_SETLK,
        libc::F_SETLKW,
    ];
    rules.insert(libc::SYS_fcntl, any(uses.map(|call| argument(1, -1, call)))?);
    // Rust starts a process with a pair of connected sockets, which reach no other process.
    rules.insert(libc::SYS_socketpair, any([argument(0, -1, libc::AF_UNIX)])?);
    // Limits of the process itself.
    rules.insert(libc::SYS_prlimit64, any([argument(0, -1, 0)])?);
    let refused = SeccompAction::Errno(libc::EPERM.cast_unsigned());
    SeccompFilter::new(rules, refused, SeccompAction::Allow, ARCH.try_into()?)
}

/// System calls of every processor: files, memory, time, and the process itself. Excluded are sockets to others,
/// signals to other processes, access to their memory, and changes of rights, owners or times of files, which
/// Landlock does not control. Processes are started before the preloaded library forbids it.
const CALLS: &[i64] = &[
    libc::SYS_brk,
    libc::SYS_chdir,
    libc::SYS_clock_getres,
    libc::SYS_clock_gettime,
    libc::SYS_clock_nanosleep,
    libc::SYS_clone,
    libc::SYS_clone3,
    libc::SYS_close,
    libc::SYS_close_range,
    libc::SYS_dup,
    libc::SYS_dup3,
    libc::SYS_epoll_create1,
    libc::SYS_epoll_ctl,
    libc::SYS_epoll_pwait,
    libc::SYS_eventfd2,
    libc::SYS_execve,
    libc::SYS_exit,
    libc::SYS_exit_group,
    libc::SYS_faccessat,
    libc::SYS_faccessat2,
    libc::SYS_fdatasync,
    libc::SYS_fstat,
    libc::SYS_fstatfs,
    libc::SYS_fsync,
    libc::SYS_ftruncate,
    libc::SYS_futex,
    libc::SYS_getcpu,
    libc::SYS_getcwd,
    libc::SYS_getdents64,
    libc::SYS_getegid,
    libc::SYS_geteuid,
    libc::SYS_getgid,
    libc::SYS_getgroups,
    libc::SYS_getitimer,
    libc::SYS_getpgid,
    libc::SYS_getpid,
    libc::SYS_getppid,
    libc::SYS_getpriority,
    libc::SYS_getrandom,
    libc::SYS_getresgid,
    libc::SYS_getresuid,
    libc::SYS_getrusage,
    libc::SYS_getsid,
    libc::SYS_gettid,
    libc::SYS_gettimeofday,
    libc::SYS_getuid,
    libc::SYS_ioctl,
    libc::SYS_linkat,
    libc::SYS_lseek,
    libc::SYS_madvise,
    libc::SYS_membarrier,
    libc::SYS_mlock,
    libc::SYS_mlockall,
    libc::SYS_mmap,
    libc::SYS_mprotect,
    libc::SYS_mremap,
    libc::SYS_munlock,
    libc::SYS_munlockall,
    libc::SYS_munmap,
    libc::SYS_nanosleep,
    libc::SYS_newfstatat,
    libc::SYS_pipe2,
    libc::SYS_ppoll,
    libc::SYS_prctl,
    libc::SYS_pread64,
    libc::SYS_pselect6,
    libc::SYS_pwrite64,
    libc::SYS_read,
    libc::SYS_readlinkat,
    libc::SYS_readv,
    libc::SYS_recvfrom,
    libc::SYS_renameat,
    libc::SYS_renameat2,
    libc::SYS_restart_syscall,
    libc::SYS_rseq,
    libc::SYS_rt_sigaction,
    libc::SYS_rt_sigpending,
    libc::SYS_rt_sigprocmask,
    libc::SYS_rt_sigreturn,
    libc::SYS_rt_sigsuspend,
    libc::SYS_rt_sigtimedwait,
    libc::SYS_sched_get_priority_max,
    libc::SYS_sched_get_priority_min,
    libc::SYS_sched_getaffinity,
    libc::SYS_sched_getparam,
    libc::SYS_sched_getscheduler,
    libc::SYS_sched_yield,
    libc::SYS_seccomp,
    libc::SYS_set_robust_list,
    libc::SYS_set_tid_address,
    libc::SYS_setitimer,
    libc::SYS_sigaltstack,
    libc::SYS_statfs,
    libc::SYS_statx,
    libc::SYS_sysinfo,
    libc::SYS_times,
    libc::SYS_umask,
    libc::SYS_uname,
    libc::SYS_unlinkat,
    libc::SYS_wait4,
    libc::SYS_waitid,
    libc::SYS_write,
    libc::SYS_writev,
];

/// Older forms of some of these calls, which newer processor architectures do not have.
#[cfg(target_arch = "x86_64")]
const OLD_CALLS: &[i64] = &[
    libc::SYS_access,
    libc::SYS_alarm,
    libc::SYS_arch_prctl,
    libc::SYS_dup2,
    libc::SYS_epoll_create,
    libc::SYS_epoll_wait,
    libc::SYS_fork,
    libc::SYS_getpgrp,
    libc::SYS_lstat,
    // LinuxCNC keeps the old parameter file with a link beside it; Landlock allows no link out of the folder.
    libc::SYS_link,
    libc::SYS_pause,
    libc::SYS_pipe,
    libc::SYS_poll,
    libc::SYS_readlink,
    libc::SYS_rename,
    libc::SYS_select,
    libc::SYS_stat,
    libc::SYS_time,
    libc::SYS_unlink,
    libc::SYS_vfork,
];
#[cfg(not(target_arch = "x86_64"))]
const OLD_CALLS: &[i64] = &[];
