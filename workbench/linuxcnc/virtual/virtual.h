// SPDX-License-Identifier: GPL-2.0-or-later
// What the files of the library know of each other.
#pragma once

#include <hal.h>
#include <rtapi.h>

#include <string>

// What LinuxCNC finds in place of its own.
#define REPLACES extern "C" __attribute__((visibility("default")))
// What the driver calls.
#define FOR_DRIVER extern "C" __attribute__((visibility("default")))

namespace clock_ {
// Nanoseconds of virtual time since the start.
long long now();
// Servo cycles since the start.
long cycles();
void set_period(unsigned long nanoseconds);
// Lets virtual time pass; calls the servo thread whenever a cycle is due.
void advance(double seconds);
}

namespace pins {
// A pin or parameter; null if there is none.
template <typename T> T *find(const std::string &name);
void *find_any(const std::string &name);
// As halcmd does it; why it cannot be done, empty where it is done.
std::string set(const std::string &name, const std::string &text);
// The value of a pin or parameter as halcmd prints it; false where there is none.
bool get(const std::string &name, std::string &text);
std::string new_signal(const std::string &name, const std::string &type);
std::string set_signal(const std::string &name, const std::string &text);
// Names of pins, separated by blanks, that match a shell pattern.
std::string names_like(const std::string &pattern);
// Puts a pin on a signal, which is made where there is none.
std::string net(const std::string &signal, const std::string &pin);
// Takes a pin off its signal.
std::string unlink(const std::string &pin);
template <typename T> T *find(const std::string &name) { return static_cast<T *>(find_any(name)); }
// A pin, with its direction, or a parameter, with that of parameters.
int add(const std::string &name, hal_type_t type, int direction, void **where, bool is_parameter = false);
}

namespace thread {
// Why a function cannot be added; empty where it is.
std::string add(const std::string &function);
void run(long period);
}

namespace wiring {
// Loads modules, sets pins and makes nets as standard input says; ends the run where that fails.
void follow();
}

namespace changer {
void export_pins();
// The buffers of all, in memory that the first who opens them makes.
void open_buffers();
// The tool data that milltask expects to find when it starts.
void open_tool_data();
void step();
}

namespace memory {
// The memory that milltask and motion share; null where there is none, or more of its kind.
void *only();
}

namespace moves {
// Finds what milltask and motion share, once the modules are loaded.
void find();
// Opens the limits of the guard, where the run asks for that; those of axes and joints come as commands.
void open_limits();
// Shows where the machine stands, as a move of its own.
void start();
// Reads the command that motion takes in this cycle.
void cycle();
struct Read {
    int line;
    // Whether the message is the interpreter's own: it stopped in this line.
    bool is_of_interpreter;
};
// What the interpreter reads as this message is written.
Read reading(const char *text);
// Number of the move that is being made, from 1; 0 before the first.
int number();
}

namespace record {
// A move that motion is asked for, in the letters of LinuxCNC: x y z a b c u v w.
struct Move {
    enum class Kind : unsigned { rapid = 0, feed = 1, probe = 2, tap = 3 };
    int line, file;
    Kind kind;
    bool is_arc, follows_spindle, spindle_turns, is_surface_speed;
    int turns;
    // Full turns of an arc that has become this straight move.
    int lost_turns;
    // In a second; 1/min; how far it may leave the path at its end, infinite where nothing is said.
    double feed, speed, tolerance;
    // Of a move that keeps to the places of the spindle (G33, G33.1): how far it goes in a turn, the fastest turning,
    // 1/min, and how fast it may be, in a second; zeros for other moves.
    double pitch, turning, fastest;
    double end[9], tool[9], center[3], normal[3];
};
void open(int descriptor);
// Whether the program runs.
bool is_on();
void move(const Move &move);
// A line in which the interpreter reads on and on.
void reading(int line);
// The next file that is read.
void file(const char *name);
// Names the pins of the rows, once everything is loaded.
void find_pins();
void cycle();
// A message to the operator: 0 an error, 1 a text, 2 a display.
void message(unsigned kind, const std::string &text);
enum class End : unsigned { finished = 0, stopped = 1, not_judged = 2 };
// Writes the last record and ends the process.
[[noreturn]] void end(End cause, const std::string &text);
}

namespace environment {
// What the command has set in the environment.
const char *folder();
const char *value(const char *name);
}

[[noreturn]] void give_up(const char *format, ...) __attribute__((format(printf, 1, 2)));
