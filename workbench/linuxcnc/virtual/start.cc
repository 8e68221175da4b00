// SPDX-License-Identifier: GPL-2.0-or-later
// LinuxCNC in virtual time: this library is preloaded into an unmodified milltask. Before milltask's own
// code runs, it loads the modules of the configuration into the same process; HAL, RTAPI and the clock are
// replaced, so that a machine that runs on this computer is not affected.

#include "virtual.h"

#include <dlfcn.h>
#include <errno.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
// Standard input must be ready when the library starts.
#include <iostream>

namespace environment {
const char *value(const char *name) {
    const char *value = getenv(name);
    return value ? value : "";
}
const char *folder() { return value("PKMKINS_VIRTUAL_FOLDER"); }
}

// ---- the driver: Python in milltask's interpreter

namespace {
int (*run_python)(const char *) = nullptr;
// Errors of LinuxCNC that the driver has not seen.
std::deque<std::string> errors;
// Cycles of milltask between two steps of the driver, each of which takes as long as several cycles.
constexpr int LOOK = 10;
int waited = LOOK;

void python(const std::string &text) {
    if (run_python(text.c_str()) != 0) {
        give_up("the driver failed");
    }
}

void start_driver() {
    run_python = reinterpret_cast<int (*)(const char *)>(dlsym(RTLD_DEFAULT, "PyRun_SimpleString"));
    if (!run_python) {
        give_up("milltask has no Python");
    }
    python(std::string("exec(open('") + environment::folder() + "/driver.py').read())");
}
}

namespace driver {
void step() {
    if (!run_python) {
        // milltask has created its pins.
        if (const std::string missing = pins::missing(); !missing.empty()) {
            give_up("%s", missing.c_str());
        }
        start_driver();
    }
    if (++waited >= LOOK || !errors.empty()) {
        waited = 0;
        python("step()");
    }
}
}

// ---- messages to the operator

namespace {
// Types of messages: errors, texts, displays.
constexpr int ERROR = 11, DISPLAY = 13;
const char PROBE[] = "pkmkins measures where a message has its text";
// Bytes before the text: 2.9 has a number there. They are measured with the first message.
size_t before_text = 0;
constexpr size_t MOST_BEFORE = 64;
bool is_probing = false;

void measure_message() {
    const Silence silence;
    is_probing = true;
    using Old = int (*)(int, const char *, ...);
    using New = int (*)(const char *, ...);
    if (const auto old_report = reinterpret_cast<Old>(dlsym(RTLD_DEFAULT, "_Z16emcOperatorErroriPKcz"))) {
        old_report(0, "%s", PROBE);
    } else if (const auto report = reinterpret_cast<New>(dlsym(RTLD_DEFAULT, "_Z16emcOperatorErrorPKcz"))) {
        report("%s", PROBE);
    }
    is_probing = false;
    if (!before_text) {
        give_up("this LinuxCNC has messages of an unknown layout");
    }
}
}

// NML::write(NMLmsg *): a message to the operator is recorded with its cycle, and an error wakes the driver.
extern "C" __attribute__((visibility("default"))) int write_message(void *, const char *, int *) __asm__(
    "_ZN3NML5writeEP6NMLmsgPi");
extern "C" int write_message(void *channel, const char *message, int *serial) {
    static const auto write =
        reinterpret_cast<int (*)(void *, const char *, int *)>(dlsym(RTLD_NEXT, "_ZN3NML5writeEP6NMLmsgPi"));
    // A message begins with its type.
    int type = 0;
    std::memcpy(&type, message, sizeof type);
    if (type < ERROR || type > DISPLAY) {
        return write(channel, message, serial);
    }
    if (is_probing) {
        for (size_t n = 0; n < MOST_BEFORE; n++) {
            before_text = std::memcmp(message + n, PROBE, sizeof PROBE) == 0 ? n : before_text;
        }
        return 0;
    }
    if (!before_text) {
        measure_message();
    }
    const char *text = message + before_text;
    if (type == ERROR) {
        errors.push_back(text);
    }
    // Nothing reads the channel, which would be full after some messages.
    record::message(static_cast<unsigned>(type - ERROR), text);
    return 0;
}

// Returns the next error that the driver has not seen, or null. LinuxCNC's Python module is not used: it ends the
// process over a text that is not UTF-8.
FOR_DRIVER const char *virtual_error() {
    static std::string seen;
    if (errors.empty()) {
        return nullptr;
    }
    seen = std::move(errors.front());
    errors.pop_front();
    return seen.c_str();
}

// ---- no other process, and no shared memory of another one

// M100 to M199 are programs of the user, and Python can start them in other ways.
[[noreturn]] static void refuse_program() {
    give_up("the program starts another program or process (M100 to M199, or by Python), which is not run");
}
REPLACES pid_t vfork(void) { refuse_program(); }
REPLACES pid_t fork(void) { refuse_program(); }
REPLACES int system(const char *) { refuse_program(); }
// Installs a filter with which the kernel refuses every other way: only threads are started. Calls that a processor
// does not have are replaced by seccomp, which is no longer needed.
static void stay_alone() {
#ifndef SYS_fork
#define SYS_fork SYS_seccomp
#define SYS_vfork SYS_seccomp
#endif
    sock_filter filter[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_execve, 8, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_execveat, 7, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_fork, 6, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_vfork, 5, 0),
        // Its flags are in memory, which a filter cannot read. The C library then uses clone.
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_clone3, 5, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_clone, 0, 2),
        // The lower half of the flags, on little-endian processors.
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, args)),
        BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, CLONE_THREAD, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
    };
    const sock_fprog program = {sizeof filter / sizeof *filter, filter};
    // pkm has already refused a kernel without filters, unless the user disabled confinement.
    syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0, &program);
}
REPLACES int shmget(int, size_t, int) {
    errno = EPERM;
    return -1;
}
REPLACES int semget(int, int, int) {
    errno = EPERM;
    return -1;
}

// Returns the path to write instead: the kernel allows writing only in the folder of the run. Files that LOGOPEN and
// the like write elsewhere go into its folder `written`, so that such a program runs.
static std::string own(const std::string &file) {
    const std::string folder = environment::folder();
    if (file.compare(0, folder.size(), folder) == 0) {
        return file;
    }
    return folder + "/written/" + file.substr(file.rfind('/') + 1);
}
static FILE *opened(const char *symbol, const char *file, const char *mode) {
    const auto open = reinterpret_cast<FILE *(*)(const char *, const char *)>(dlsym(RTLD_NEXT, symbol));
    const bool reads = mode[0] == 'r' && !std::strchr(mode, '+');
    return open(reads ? file : own(file).c_str(), mode);
}
REPLACES FILE *fopen(const char *file, const char *mode) { return opened("fopen", file, mode); }
// milltask of 2.10 starts with a folder for its crashes; the kernel allows no other one.
REPLACES int mkdir(const char *folder, mode_t mode) {
    static const auto make = reinterpret_cast<int (*)(const char *, mode_t)>(dlsym(RTLD_NEXT, "mkdir"));
    return std::strcmp(folder, "/tmp/linuxcnc") == 0 ? 0 : make(folder, mode);
}
REPLACES FILE *fopen64(const char *file, const char *mode) { return opened("fopen64", file, mode); }

namespace {
struct Start {
    Start() {
        if (std::strcmp(program_invocation_short_name, "pkm-control") != 0) {
            return;
        }
        unsetenv("LD_PRELOAD");
        // The reader of the records may be killed.
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        stay_alone();
        record::open(std::atoi(environment::value("PKMKINS_VIRTUAL_STREAM")));
        slots::check();
        changer::start();
        wiring::follow();
        moves::find();
        moves::open_limits();
        record::find_pins();
    }
} start;
}
