// SPDX-License-Identifier: GPL-2.0-or-later
// The events of a run, as a stream of records for the process that started it:
//
//     u32 kind, u32 bytes that follow, then
//     1 head      u32 version of these records; once, first
//     2 row       a servo cycle: u64 cycle, i32 line, u32 flags (1 on, 2 tool busy, 4 feed inhibited), u32 number
//                 of the move, f64 feed, pose[9], tool[6] (that of a second mechanism last),
//                 then for every joint command, following error and its limit
//     3 message   u64 cycle, i32 line, u32 kind (from 256 up from the interpreter), i32 line being read, u32 its file
//                 (0 if not from the interpreter), text
//     4 end       u64 cycle, i32 line, u32 cause (record::End), text; last
//     5 move      as commanded, before it begins: i32 line, u32 file, u32 kind (record::Move::Kind),
//                 u32 flags (1 arc, 2 follows the spindle, 4 the spindle turns, 8 at a constant surface speed),
//                 i32 turns, u32 turns of an arc that has become straight, then f64 feed, speed, tolerance,
//                 pitch, turning, fastest, end[9], tool[9], center[3], normal[3]
//     6 file      its name; files count from 0, the program
//     7 reading   i32 line in which the interpreter reads endlessly
//
// Moves count from 0; the first one ends where the program starts.
// Numbers have the computer's format; cycles count from the start of the program.

#include "virtual.h"

#include <errno.h>
#include <stdarg.h>
#include <stdint.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <vector>

namespace {
constexpr int VERSION = 7;
constexpr size_t BLOCK = 1 << 16;
// Number of coordinates of a pose, and of values of the tool offsets of two mechanisms.
constexpr int LETTERS = 9, TOOLS = 6;
constexpr unsigned HEAD = 1, ROW = 2, MESSAGE = 3, END = 4, MOVE = 5, FILE_NAME = 6, READING = 7, OF_INTERPRETER = 256;

struct Joint {
    const double *command, *error, *allowed;
};

int out = -1;
std::vector<char> block;
bool is_recording = false;
long started = 0;
int last_line = 0;

const int *line_pin;
const bool *on_pin, *busy_pin, *held_pin;
const double *feed_pin;
const double none = 0;
const double *pose_pins[LETTERS], *tool_pins[TOOLS];
double last_pose[LETTERS];
std::vector<Joint> joints;

void flush() {
    for (size_t done = 0; done < block.size();) {
        const ssize_t count = write(out, block.data() + done, block.size() - done);
        if (count < 0 && errno != EINTR) {
            // The reader is gone.
            _exit(1);
        }
        done += count > 0 ? static_cast<size_t>(count) : 0;
    }
    block.clear();
}

template <typename T> void put(const T &value) {
    const char *bytes = reinterpret_cast<const char *>(&value);
    block.insert(block.end(), bytes, bytes + sizeof value);
}

void put_head(unsigned kind, size_t bytes) {
    put(static_cast<uint32_t>(kind));
    put(static_cast<uint32_t>(bytes));
}

uint64_t cycle_of_program() { return is_recording ? static_cast<uint64_t>(clock_::cycles() - started) : 0; }

void put_text(unsigned kind, unsigned number, const std::string &text) {
    put_head(kind, sizeof(uint64_t) + 2 * sizeof(uint32_t) + text.size());
    put(cycle_of_program());
    put(static_cast<int32_t>(last_line));
    put(static_cast<uint32_t>(number));
    block.insert(block.end(), text.begin(), text.end());
    flush();
}

template <typename T> const T *needed(const std::string &name) {
    const T *pin = pins::find<T>(name);
    if (!pin) {
        give_up("there is no pin %s", name.c_str());
    }
    return pin;
}

// Updates the line of the present or last move: LinuxCNC clears it when it aborts.
void follow_line() {
    bool moves = false;
    for (int n = 0; n < LETTERS; n++) {
        moves |= last_pose[n] != *pose_pins[n];
        last_pose[n] = *pose_pins[n];
    }
    if (moves && *line_pin > 0) {
        last_line = *line_pin;
    }
}
}

namespace record {
void open(int descriptor) {
    out = descriptor;
    put_head(HEAD, sizeof(uint32_t));
    put(static_cast<uint32_t>(VERSION));
    flush();
}

void find_pins() {
    line_pin = needed<int>("motion.program-line");
    on_pin = needed<bool>("motion.motion-enabled");
    busy_pin = needed<bool>("pkmkins.tool-busy");
    held_pin = needed<bool>("pkmkins.feed-inhibit");
    feed_pin = needed<double>("pkmkins.feed-scale");
    for (int n = 0; n < LETTERS; n++) {
        pose_pins[n] = needed<double>(std::string("axis.") + "xyzabcuvw"[n] + ".pos-cmd");
    }
    for (int n = 0; n < 3; n++) {
        const std::string name = std::string("tool-offset-eff-") + "xyz"[n];
        tool_pins[n] = needed<double>("pkmkins." + name);
        const double *second = pins::find<double>("pkmkins.second." + name);
        tool_pins[n + 3] = second ? second : &none;
    }
    for (int n = 0;; n++) {
        const std::string joint = "joint." + std::to_string(n);
        if (!pins::find_any(joint + ".pos-cmd")) {
            break;
        }
        joints.push_back({needed<double>(joint + ".pos-cmd"), needed<double>(joint + ".f-error"),
                          needed<double>(joint + ".f-error-lim")});
    }
}

void cycle() {
    if (!is_recording) {
        return;
    }
    follow_line();
    // It may end the run, before a record is begun.
    const int number = moves::number();
    put_head(ROW, sizeof(uint64_t) + 3 * sizeof(uint32_t) + sizeof(double) * (1 + LETTERS + TOOLS + 3 * joints.size()));
    put(cycle_of_program());
    put(static_cast<int32_t>(*line_pin));
    put(static_cast<uint32_t>(*on_pin | *busy_pin << 1 | *held_pin << 2));
    put(static_cast<uint32_t>(number));
    put(*feed_pin);
    for (const double *pin : pose_pins) {
        put(*pin);
    }
    for (const double *pin : tool_pins) {
        put(*pin);
    }
    for (const Joint &joint : joints) {
        put(*joint.command);
    }
    for (const Joint &joint : joints) {
        put(*joint.error);
    }
    for (const Joint &joint : joints) {
        put(*joint.allowed);
    }
    if (block.size() > BLOCK) {
        flush();
    }
}

bool is_on() { return is_recording; }

void file(const char *name) {
    const size_t length = std::strlen(name);
    put_head(FILE_NAME, length);
    block.insert(block.end(), name, name + length);
}

void reading(int line) {
    put_head(READING, sizeof(int32_t));
    put(static_cast<int32_t>(line));
    flush();
}

void move(const Move &move) {
    const double values[] = {move.feed, move.speed, move.tolerance, move.pitch, move.turning, move.fastest};
    put_head(MOVE, 6 * sizeof(uint32_t) + sizeof values + sizeof move.end + sizeof move.tool + sizeof move.center +
                       sizeof move.normal);
    put(static_cast<int32_t>(move.line));
    put(static_cast<uint32_t>(move.file));
    put(static_cast<uint32_t>(move.kind));
    put(static_cast<uint32_t>(move.is_arc | move.follows_spindle << 1 | move.spindle_turns << 2 |
                              move.is_surface_speed << 3 | move.is_per_turn << 4));
    put(static_cast<int32_t>(move.turns));
    put(static_cast<uint32_t>(move.lost_turns));
    put(values);
    put(move.end);
    put(move.tool);
    put(move.center);
    put(move.normal);
    if (block.size() > BLOCK) {
        flush();
    }
}

void message(unsigned kind, const std::string &text) {
    const auto [line, file, is_of_interpreter] = moves::reading(text.c_str());
    kind |= is_of_interpreter ? OF_INTERPRETER : 0;
    const int32_t place[] = {line, file};
    put_text(MESSAGE, kind, std::string(reinterpret_cast<const char *>(place), sizeof place) + text);
}

void end(End cause, const std::string &text) {
    put_text(END, static_cast<unsigned>(cause), text);
    _exit(0);
}
}

void give_up(const char *format, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    record::end(record::End::not_judged, text);
}

FOR_DRIVER void virtual_record() {
    is_recording = true;
    started = clock_::cycles();
    moves::start();
}
FOR_DRIVER void virtual_end(unsigned cause, const char *text) {
    record::end(static_cast<record::End>(cause), text);
}
