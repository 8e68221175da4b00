// SPDX-License-Identifier: GPL-2.0-or-later
// The functions that the files of the library share.
#pragma once

#include <fcntl.h>
#include <stddef.h>
#include <unistd.h>

#include <string>
#include <vector>

// What HAL and RTAPI of all supported versions have in common.
enum hal_type_t { HAL_BIT = 1, HAL_FLOAT = 2, HAL_S32 = 3, HAL_U32 = 4, HAL_S64 = 6, HAL_U64 = 7 };
enum { HAL_IN = 16, HAL_OUT = 32, HAL_IO = 48, HAL_RO = 64, HAL_RW = 192 };
constexpr int RTAPI_MSG_ERR = 1, RTAPI_MSG_ALL = 5;

// Replaces a function of LinuxCNC's.
#define REPLACES extern "C" __attribute__((visibility("default")))
// Called by the driver.
#define FOR_DRIVER extern "C" __attribute__((visibility("default")))

namespace clock_ {
// Returns the nanoseconds of virtual time since the start.
long long now();
// Returns the servo cycles since the start.
long cycles();
void set_period(unsigned long nanoseconds);
// Lets LinuxCNC's waiting loops end at once: time passes with every look at the clock, without a cycle.
void rush(bool on);
// Lets virtual time pass; calls the servo thread whenever a cycle is due.
void advance(double seconds);
}

namespace pins {
// Returns a pin or parameter; null if there is none.
template <typename T> T *find(const std::string &name);
void *find_any(const std::string &name);
// Sets it as halcmd does; returns the error, or empty.
std::string set(const std::string &name, const std::string &text);
// Returns the value of a pin or parameter as halcmd prints it; false if there is none.
bool get(const std::string &name, std::string &text);
std::string new_signal(const std::string &name, const std::string &type);
std::string set_signal(const std::string &name, const std::string &text);
// Returns the names of pins, separated by blanks, that match a shell pattern.
std::string names_like(const std::string &pattern);
// Connects a pin to a signal, which is created if there is none.
std::string net(const std::string &signal, const std::string &pin);
// Lets a net wait for a pin of milltask's that does not exist yet.
void expect(const std::string &prefix);
// Returns the first net that still waits for its pin, as an error, or empty.
std::string missing();
// Disconnects a pin from its signal.
std::string unlink(const std::string &pin);
template <typename T> T *find(const std::string &name) { return static_cast<T *>(find_any(name)); }
// Adds a pin, with its direction, or a parameter, with that of parameters; has_room: whether its value has the room of
// the largest type.
int add(const std::string &name, hal_type_t type, int direction, void **where, bool is_parameter = false,
        bool has_room = true);
}

namespace thread {
// Adds a function to the servo thread; returns the error, or empty.
std::string add(const std::string &function);
// Calls a function once.
void call(const std::string &function);
void run(long period);
}

namespace wiring {
// Loads modules, sets pins and makes nets as commanded on standard input; ends the run on an error.
void follow();
}

namespace changer {
// Opens the buffers of all processes, and starts 2.9's changer; later versions have it in milltask.
void start();
void step();
}

namespace memory {
// Returns the memory that milltask and motion share, with its size; null if there is none, or more than one.
void *only(size_t &size);
}

namespace slots {
// Puts another function into the slots through which a library calls one; returns whether it has any.
bool replace(const char *library, const char *symbol, void *replacement);
// Ends the run if a loaded file uses a function of HAL or RTAPI that has no substitute here.
void check();
}

namespace layout {
// The tag of a move: its values are floats in 2.9, later doubles. Places in bytes.
struct Tag {
    bool is_old;
    size_t line, flags, size;
};
constexpr size_t OLD_SIZE = 64, NEW_SIZE = 384, MOST_OF_TAG = 512;
struct Spindle {
    double speed, factor, offset;
    bool turns;
};
// Places of the fields of a spindle's status in the shared memory.
struct SpindlePlaces {
    size_t speed, factor, offset, state, orient;
};
// Places of the fields of a command in the shared memory, and the codes of commands.
struct Layout {
    char *memory;
    size_t code, id, kind, turn, end, feed, fastest, scale, center, normal, tag, condition, tolerance, pitch, waits, spindle,
        low, high;
    int line, circle, probe, tap, set_condition, set_sync, joint_limits, axis_limits;
    // Number of commands that were written for the measurement.
    int commands;
    Tag of_tag;
    std::vector<SpindlePlaces> spindles;

    template <typename T> T &field(size_t place) const { return *reinterpret_cast<T *>(memory + place); }
    Spindle spindle_of(size_t n) const;
};
Layout measure();
}

namespace moves {
// Finds the shared memory of milltask and motion, once the modules are loaded.
void find();
// Removes the limits of the guard, if the run requests it; commands remove those of axes and joints.
void open_limits();
// Records the initial position of the machine, as a move.
void start();
// Reads the command that motion accepts in this cycle.
void cycle();
struct Read {
    int line;
    // Of a message of the interpreter.
    int file;
    // Whether the message is the interpreter's: it stopped in this line.
    bool is_of_interpreter;
};
// Returns the interpreter's reading state as this message is written.
Read reading(const char *text);
// Returns the number of the present move, from 1; 0 before the first.
int number();
}

namespace record {
// A commanded move, in the letters of LinuxCNC: x y z a b c u v w.
struct Move {
    enum class Kind : unsigned { rapid = 0, feed = 1, probe = 2, tap = 3 };
    int line, file;
    Kind kind;
    bool is_arc, follows_spindle, spindle_turns, is_surface_speed, is_per_turn;
    int turns;
    // Full turns of an arc that was reduced to this straight move.
    int lost_turns;
    // Per second; 1/min; allowed deviation from the path at its end, infinite if not set.
    double feed, speed, tolerance;
    // For a move synchronized with the spindle's position (G33, G33.1): its distance per turn, the largest spindle
    // speed, 1/min, and its largest speed per second; zeros for other moves.
    double pitch, turning, fastest;
    double end[9], tool[9], center[3], normal[3];
};
void open(int descriptor);
// Returns whether the program runs.
bool is_on();
void move(const Move &move);
// Records a line in which the interpreter reads endlessly.
void reading(int line);
// Records the next file that is read.
void file(const char *name);
// Finds the pins of the rows, once everything is loaded.
void find_pins();
void cycle();
// Records a message to the operator: 0 an error, 1 a text, 2 a display.
void message(unsigned kind, const std::string &text);
enum class End : unsigned { finished = 0, stopped = 1, not_judged = 2 };
// Writes the last record and ends the process.
[[noreturn]] void end(End cause, const std::string &text);
}

namespace environment {
// Returns the value that the command has set in the environment.
const char *folder();
const char *value(const char *name);
}

[[noreturn]] void give_up(const char *format, ...) __attribute__((format(printf, 1, 2)));

// Suppresses what LinuxCNC prints meanwhile.
struct Silence {
    int kept[2] = {dup(STDOUT_FILENO), dup(STDERR_FILENO)};
    Silence() {
        const int nothing = open("/dev/null", O_WRONLY);
        dup2(nothing, STDOUT_FILENO);
        dup2(nothing, STDERR_FILENO);
        close(nothing);
    }
    ~Silence() {
        for (int n = 0; n < 2; n++) {
            dup2(kept[n], n + STDOUT_FILENO);
            close(kept[n]);
        }
    }
    Silence(const Silence &) = delete;
    Silence &operator=(const Silence &) = delete;
};
