// SPDX-License-Identifier: GPL-2.0-or-later
// The clock of LinuxCNC's programs: time passes only while they wait for it.

#include "virtual.h"

#include <dlfcn.h>

#include <cmath>

namespace {
// Any moment but 0, which LinuxCNC's timers interpret as "not yet".
constexpr long long START = 1'000'000'000'000;
// Waits shorter than this are polls for an answer of the servo thread, which comes with its next cycle.
constexpr double POLL = 1e-4;

long long time_ = START;
long long next_ = 0;
long period_ = 1'000'000;
long cycles_ = 0;
// The driver waits for answers that arrive only after it returns: its own clock runs ahead meanwhile.
bool in_driver_ = false;
double ahead_ = 0.0;
bool in_rush_ = false;
constexpr double RUSH = 1000.0;

void run_cycle() {
    time_ = next_;
    next_ += period_;
    cycles_++;
    thread::run(period_);
    record::cycle();
}
}

namespace clock_ {
long long now() { return time_; }
long cycles() { return cycles_; }

void set_period(unsigned long nanoseconds) {
    period_ = static_cast<long>(nanoseconds);
    next_ = time_ + period_;
}

void rush(bool on) {
    in_rush_ = on;
    ahead_ = 0.0;
}

void advance(double seconds) {
    const long long end = time_ + std::llround(seconds * 1e9);
    while (next_ != 0 && next_ <= end) {
        run_cycle();
    }
    time_ = end > time_ ? end : time_;
}
}

namespace driver {
void step();
}

REPLACES double etime() {
    ahead_ += in_rush_ ? RUSH : 0.0;
    return 1e-9 * static_cast<double>(time_) + (in_driver_ || in_rush_ ? ahead_ : 0.0);
}

REPLACES void esleep(double seconds) {
    if (in_driver_) {
        ahead_ += seconds;
        return;
    }
    if (seconds < POLL && next_ > time_) {
        seconds = 1e-9 * static_cast<double>(next_ - time_);
    }
    clock_::advance(seconds);
    changer::step();
}

// RCS_TIMER::wait(), the end of each of milltask's own cycles.
extern "C" __attribute__((visibility("default"))) int wait_of_timer(void *timer) __asm__(
    "_ZN9RCS_TIMER4waitEv");
extern "C" int wait_of_timer(void *timer) {
    static const auto wait =
        reinterpret_cast<int (*)(void *)>(dlsym(RTLD_NEXT, "_ZN9RCS_TIMER4waitEv"));
    const int missed = wait(timer);
    in_driver_ = true;
    ahead_ = 0.0;
    driver::step();
    in_driver_ = false;
    return missed;
}
