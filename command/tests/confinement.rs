// SPDX-License-Identifier: GPL-2.0-or-later
//! Forbidden actions of a run, each refused by the kernel, and the state after an interruption.

use crate::control::{Copy, SHORT, control_of};
use seccompiler::{BpfProgram, SeccompAction, SeccompFilter, apply_filter};
use std::env::consts::ARCH;
use std::fs;
use std::net::{TcpListener, UdpSocket};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixListener;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Output};
use test_support::control::ended;

/// Returns a program with these lines of Python.
fn python(lines: &[String]) -> String {
    let lines: String = lines.iter().map(|line| format!(";py,{line}\n")).collect();
    format!("G21 G90\n{lines}G0 X1\nM2\n")
}

/// Adds the INI section that Python in LinuxCNC's interpreter needs.
fn with_python(text: String) -> String {
    text + "\n[PYTHON]\nPATH_APPEND = .\n"
}

fn run(copy: &Copy, arguments: &[&str]) -> (String, Option<i32>) {
    let Output { stdout, stderr, status } = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg("run")
        .args([copy.file("hexapod.ini"), copy.file("programs/p.ngc")])
        .args(arguments)
        .env("TMPDIR", copy.file("tmp"))
        .output()
        .unwrap();
    assert_eq!(fs::read_dir(copy.file("tmp")).unwrap().count(), 0, "left behind");
    (String::from_utf8_lossy(&[stdout, stderr].concat()).into_owned(), status.code())
}

/// Checks that Python is refused, with the words of the kernel.
fn refused(lines: &[String], words: &str) {
    let copy = Copy::new(with_python, &python(lines));
    let (text, code) = run(&copy, &[]);
    assert_eq!(code, Some(1), "{lines:?}: {text}");
    // A link from another folder is refused like one between devices.
    let is_refused = text.contains(words) || text.contains("Invalid cross-device link");
    assert!(is_refused, "{lines:?}: {text}");
}

#[test]
fn python_in_a_program_runs_where_it_touches_nothing() {
    let copy = Copy::new(with_python, &python(&["import math".into(), "x = math.pi".into()]));
    let (text, code) = run(&copy, &[]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn a_file_outside_the_run_is_not_written_and_none_is_changed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("precious.txt");
    fs::write(&file, "precious").unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
    let (name, folder) = (file.display(), folder.path().display());
    let denied = "Permission denied";
    let forbidden = "Operation not permitted";
    for (line, words) in [
        (format!("open('{name}', 'w')"), denied),
        (format!("open('/proc/self/root{name}', 'a')"), denied),
        (format!("open('{folder}/new', 'x')"), denied),
        (format!("import os; os.remove('{name}')"), denied),
        (format!("import os; os.rename('{name}', '{folder}/other')"), denied),
        (format!("import os; os.link('{name}', 'linked')"), forbidden),
        (format!("import os; os.symlink('{name}', 'linked')"), forbidden),
        (format!("import os; os.truncate('{name}', 0)"), forbidden),
        (format!("import os; os.open('{name}', os.O_RDONLY | os.O_TRUNC)"), forbidden),
        (format!("import os; os.chmod('{name}', 0)"), forbidden),
        (format!("import os; os.utime('{name}', (0, 0))"), forbidden),
        (format!("import os; os.setxattr('{name}', 'user.x', b'x')"), forbidden),
        (format!("import os; os.mkdir('{folder}/made')"), forbidden),
    ] {
        refused(&[line], words);
    }
    for place in
        [name.to_string(), format!("/proc/self/root{name}"), format!("/proc/self/cwd/../..{name}")]
    {
        let copy =
            Copy::new(|text| text, &format!("(LOGOPEN,{place})\n(LOG,gone)\n(LOGCLOSE)\n{SHORT}"));
        let (text, code) = run(&copy, &["--written", &copy.file("kept").display().to_string()]);
        assert_eq!(code, Some(0), "{text}");
        assert_eq!(fs::read_to_string(copy.file("kept/precious.txt")).unwrap().trim(), "gone");
    }
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");
    assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
    assert_eq!(fs::read_dir(file.parent().unwrap()).unwrap().count(), 1);
}

#[test]
fn a_secret_outside_the_run_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("secret");
    fs::write(&file, "o<secret> sub\no<secret> endsub\n").unwrap();
    for name in [file.display().to_string(), format!("/proc/self/root{}", file.display())] {
        refused(&[format!("open('{name}').read()")], "Permission denied");
    }
    refused(&["open('/etc/shadow').read()".into()], "Permission denied");
    refused(&["open('/proc/1/environ').read()".into()], "Permission denied");
    refused(&["import os; os.listdir('/home')".into()], "Permission denied");
}

#[test]
fn a_program_connects_to_nothing() {
    let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
    let udp = UdpSocket::bind("127.0.0.1:0").unwrap();
    udp.set_nonblocking(true).unwrap();
    tcp.set_nonblocking(true).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let local = folder.path().join("socket");
    let unix = UnixListener::bind(&local).unwrap();
    unix.set_nonblocking(true).unwrap();
    let [tcp_port, udp_port] = [tcp.local_addr(), udp.local_addr()].map(|at| at.unwrap().port());
    // LinuxCNC's messages end after 255 bytes: the C part of Python's module fails in one line.
    for line in [
        format!("import _socket as s; s.socket(2, 1).connect(('127.0.0.1', {tcp_port}))"),
        format!(
            "import _socket as s; s.socket(s.AF_INET, s.SOCK_DGRAM).sendto(b'x', ('127.0.0.1', {udp_port}))"
        ),
        format!("import _socket as s; s.socket(s.AF_UNIX).connect('{}')", local.display()),
    ] {
        refused(&[line], "Operation not permitted");
    }
    assert!(tcp.accept().is_err() && unix.accept().is_err() && udp.recv(&mut [0]).is_err());
}

#[test]
fn a_program_starts_no_other_and_sends_it_no_signal() {
    let folder = tempfile::tempdir().unwrap();
    let started = folder.path().join("started");
    let script = format!("touch {}", started.display());
    for line in [
        format!("import os; os.system('{script}')"),
        format!("import subprocess; subprocess.run('{script}', shell=True)"),
        "import os; os.fork()".into(),
    ] {
        let copy = Copy::new(with_python, &python(&[line]));
        let (text, code) = run(&copy, &[]);
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains("the program starts another program or process"), "{text}");
    }
    let shell = "'/bin/sh', ['sh', '-c', 'true']";
    for line in [
        format!("import os; os.execv({shell})"),
        format!("import os; os.posix_spawn({shell}, {{}})"),
        // The loader of programs is started with each of them, and could start any.
        "import os; os.execv('/lib64/ld-linux-x86-64.so.2', ['ld.so', '/bin/true'])".into(),
        // SYS_clone with only SIGCHLD is fork. After its refusal, Python opens a forbidden file, too.
        "import ctypes as c; c.CDLL(None).syscall(56, 17, 0, 0, 0, 0) < 0 and open('/')".into(),
        "import os; os.kill(os.getppid(), 0)".into(),
    ] {
        let copy = Copy::new(with_python, &python(&[line]));
        let (text, code) = run(&copy, &[]);
        assert_eq!(code, Some(1), "{text}");
        assert!(
            text.contains("Operation not permitted") || text.contains("Permission denied"),
            "{text}"
        );
    }
    assert!(!started.exists());
}

#[test]
fn a_hal_file_writes_reads_and_starts_nothing_of_the_users() {
    let folder = tempfile::tempdir().unwrap();
    let (secret, place) = (folder.path().join("secret"), folder.path().display());
    fs::write(&secret, "secret").unwrap();
    for line in [
        "exec true 2>@stderr".into(),
        format!("open {place}/new w"),
        format!("open {place}/secret"),
        "socket 127.0.0.1 1".into(),
        format!("exec /lib64/ld-linux-x86-64.so.2 /bin/touch {place}/started 2>@stderr"),
    ] {
        // Tcl reports a socket that cannot be created as an unreachable host. The loader cannot read the program.
        let words = ["permission denied", "host is unreachable", "cannot open shared object file"];
        let copy = Copy::new(|text| text, SHORT);
        let hal = copy.file("more.tcl");
        fs::write(&hal, format!("{line}\n")).unwrap();
        let (text, code) = run(&copy, &["--hal", &hal.display().to_string()]);
        assert_eq!(code, Some(2), "{line}: {text}");
        assert!(words.iter().any(|word| text.contains(word)), "{line}: {text}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_section_that_is_a_variable_of_tcls_own_is_refused_and_named_by_check() {
    for section in ["env", "auto_index", "tcl_platform", "argv"] {
        let folder = tempfile::tempdir().unwrap();
        let mark = folder.path().join("mark");
        let lines = format!("\n[{section}]\nBASH_ENV = $(touch {})\n", mark.display());
        let copy = Copy::new(|text| text + &lines, SHORT);
        let (text, code) = run(&copy, &[]);
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains(&format!("[{section}]")) && text.contains("Tcl"), "{text}");
        let check = Command::new(env!("CARGO_BIN_EXE_pkm"))
            .arg("check")
            .arg(copy.file("hexapod.ini"))
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&check.stdout).into_owned();
        assert!(text.contains(&format!("[{section}]")) && text.contains("Tcl"), "{text}");
        assert!(!mark.exists());
    }
}

#[test]
fn without_landlock_nothing_is_run_unless_the_user_allows_it() {
    let copy = Copy::new(with_python, &python(&[]));
    let run = |arguments: &'static [&'static str]| {
        // The response of a kernel without Landlock, for one thread and its children.
        let calls = [(libc::SYS_landlock_create_ruleset, vec![])].into();
        let missing = SeccompAction::Errno(libc::ENOSYS.cast_unsigned());
        let filter =
            SeccompFilter::new(calls, SeccompAction::Allow, missing, ARCH.try_into().unwrap());
        let filter: BpfProgram = filter.unwrap().try_into().unwrap();
        std::thread::scope(|scope| {
            scope
                .spawn(|| {
                    apply_filter(&filter).unwrap();
                    run(&copy, arguments)
                })
                .join()
                .unwrap()
        })
    };
    let (text, code) = run(&[]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("Landlock") && text.contains("--unconfined"), "{text}");
    let (text, code) = run(&["--unconfined"]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn what_a_program_writes_is_kept_whole_and_over_no_file_that_was_read() {
    let copy = Copy::new(|text| text, &format!("(LOGOPEN,p.ngc)\n(LOG,gone)\n(LOGCLOSE)\n{SHORT}"));
    let before = fs::read_to_string(copy.file("programs/p.ngc")).unwrap();
    let (text, code) = run(&copy, &["--written", &copy.file("programs").display().to_string()]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("was read as input"), "{text}");
    assert_eq!(fs::read_to_string(copy.file("programs/p.ngc")).unwrap(), before);
}

/// Starts a command that runs the program of a copy and writes its trace.
fn started(command: &str, copy: &Copy) -> Child {
    Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg(command)
        .args([copy.file("hexapod.ini"), copy.file("programs/p.ngc")])
        .arg("--trace")
        .arg(copy.file("trace.csv"))
        .env("TMPDIR", copy.file("tmp"))
        .spawn()
        .unwrap()
}

#[test]
fn an_interruption_leaves_no_part_of_a_file() {
    // Continuously writes a log, and the trace.
    let text = "G21 G90\no1 while [1]\n(LOGOPEN,log.txt)\n(LOG,x)\n(LOGCLOSE)\nG0 X1\nG0 X-1\no1 endwhile\nM2\n";
    for (command, signal) in ["run", "preflight"]
        .into_iter()
        .flat_map(|command| ["-INT", "-TERM", "-HUP"].map(|signal| (command, signal)))
    {
        let copy = Copy::new(|text| text, text);
        let mut child = started(command, &copy);
        let control = control_of(child.id());
        let part = || parts(&copy.file("")).next().is_some();
        assert!((0..1000).any(|_| {
            std::thread::sleep(std::time::Duration::from_millis(10));
            part()
        }));
        let killed = Command::new("kill").args([signal, &child.id().to_string()]).status();
        assert!(killed.unwrap().success());
        assert_eq!(ended(&mut child).code(), Some(130), "{command} {signal}");
        assert!(!part() && !copy.file("trace.csv").exists(), "{command} {signal}: a part is left");
        assert_eq!(fs::read_dir(copy.file("tmp")).unwrap().count(), 0, "{command} {signal}");
        let proc = Path::new("/proc").join(&control);
        assert!((0..500).any(|_| {
            std::thread::sleep(std::time::Duration::from_millis(10));
            !proc.exists()
        }));
    }
}

#[test]
fn an_interruption_at_any_moment_leaves_nothing() {
    // Between the start of the process and the middle of the program.
    for n in 0..10_u64 {
        let signal = [libc::SIGINT, libc::SIGTERM, libc::SIGHUP][n as usize % 3];
        let text = "G21 G90\no1 while [1]\nG0 X1\nG0 X-1\no1 endwhile\nM2\n";
        let copy = Copy::new(|text| text, text);
        let mut child = started("preflight", &copy);
        std::thread::sleep(std::time::Duration::from_millis(5 + n * n * 10 + 7 * (n % 4)));
        let killed =
            Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status();
        assert!(killed.unwrap().success());
        let status = ended(&mut child);
        // The first moments have no handler yet.
        assert!(status.code() == Some(130) || status.signal() == Some(signal), "{n}: {status}");
        assert!(parts(&copy.file("")).next().is_none() && !copy.file("trace.csv").exists(), "{n}");
        assert_eq!(fs::read_dir(copy.file("tmp")).unwrap().count(), 0, "{n}: a folder is left");
        let folder = copy.file("tmp").display().to_string();
        let is_left =
            || Command::new("pgrep").args(["-f", &folder]).output().unwrap().status.success();
        assert!(
            (0..500).any(|_| {
                std::thread::sleep(std::time::Duration::from_millis(10));
                !is_left()
            }),
            "{n}: a process is left"
        );
    }
}

fn parts(folder: &Path) -> impl Iterator<Item = String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    names.filter_map(|name| name.into_string().ok()).filter(|name| name.starts_with(".pkm-"))
}
