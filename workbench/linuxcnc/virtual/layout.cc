// SPDX-License-Identifier: GPL-2.0-or-later
// Measures where milltask puts the fields of its commands to motion. They are in memory that no installed header
// declares and that differs between versions. Before milltask starts, its own functions are called with values that
// occur nowhere else; each value must then be found in exactly one place. Motion sees none of these commands.

#include "virtual.h"

#include <dlfcn.h>

#include <cstring>
#include <utility>
#include <vector>

namespace {
constexpr size_t MOST = 8192;
// Bytes behind a spindle's factor for constant surface speed that may contain its states.
constexpr size_t NEAR = 64;
// A limit of the spindle's speed that no measured value exceeds.
constexpr double FASTEST = 1e9;
// States of a spindle: it is on; it is turning to the angle of M19.
constexpr int ON = 1, IN_PROGRESS = 2;

// The tag of 2.9 and that of 2.10: its values, then whole numbers, of which the first is the line, then flags.
constexpr layout::Tag TAGS[] = {{true, 20, 56, layout::OLD_SIZE}, {false, 88, 120, layout::NEW_SIZE}};

// EmcPose and PM_CARTESIAN. 2.9 passes EmcPose by value; a class that has its own copy constructor is always passed by
// reference.
struct Pose {
    double values[9];
};
struct Vector {
    double values[3];
};

[[noreturn]] void refuse(const char *what) {
    give_up("this LinuxCNC passes commands to motion in an unknown way (%s): see pkm help guide/install for the "
            "supported versions",
            what);
}

template <typename Call> Call found(const char *name) { return reinterpret_cast<Call>(dlsym(RTLD_DEFAULT, name)); }
template <typename Call> Call needed(const char *name) {
    const Call call = found<Call>(name);
    if (!call) {
        refuse(name);
    }
    return call;
}

class Bench {
  public:
    explicit Bench(char *memory, size_t size)
        : memory_(memory), size_(size), length_(size < MOST ? size : MOST), before_(memory, memory + size) {
        clock_::rush(true);
    }
    // Motion sees the memory as it was.
    ~Bench() {
        std::memcpy(memory_, before_.data(), size_);
        clock_::rush(false);
    }

    double number() { return 1000.25 + ++values_; }
    int whole() { return 0x5a0000 + ++values_; }
    Pose pose() {
        Pose pose;
        for (double &value : pose.values) {
            value = number();
        }
        return pose;
    }

    // Keeps the command that a function of milltask has just written.
    void sees(int function) {
        functions_.push_back(function);
        commands_.emplace_back(memory_, memory_ + length_);
    }

    template <typename T> size_t place(T value, const char *what) const {
        size_t place = 0, count = 0;
        for (size_t at = 0; at + sizeof(T) <= length_; at += alignof(T)) {
            if (value_at<T>(commands_.size() - 1, at) == value) {
                place = at;
                count++;
            }
        }
        if (count != 1) {
            refuse(what);
        }
        return place;
    }
    template <size_t N> size_t places(const double (&values)[N], const char *what) const {
        const size_t first = place(values[0], what);
        if (std::memcmp(commands_.back().data() + first, values, sizeof values) != 0) {
            refuse(what);
        }
        return first;
    }
    // Returns where the last three commands differ as 0, 1, 0.
    size_t toggled(const char *what) const {
        const size_t last = commands_.size() - 1;
        size_t place = 0, count = 0;
        for (size_t at = 0; at < length_; at++) {
            if (commands_[last - 2][at] == 0 && commands_[last - 1][at] == 1 && commands_[last][at] == 0) {
                place = at;
                count++;
            }
        }
        if (count != 1) {
            refuse(what);
        }
        return place;
    }
    // Returns the place of the command's code, with its number behind it: only the same function has the same code.
    size_t code() const {
        size_t place = 0, count = 0;
        for (size_t at = 0; at + 2 * sizeof(int) <= length_; at += sizeof(int)) {
            bool is_code = true;
            for (size_t n = 0; n < commands_.size() && is_code; n++) {
                is_code = value_at<int>(n, at + sizeof(int)) == static_cast<int>(n) + 1;
                for (size_t other = 0; other < n && is_code; other++) {
                    is_code =
                        (value_at<int>(n, at) == value_at<int>(other, at)) == (functions_[n] == functions_[other]);
                }
            }
            if (is_code) {
                place = at;
                count++;
            }
        }
        if (count != 1) {
            refuse("the code of a command");
        }
        return place;
    }
    int code_of(int function, size_t place) const {
        for (size_t n = 0; n < functions_.size(); n++) {
            if (functions_[n] == function) {
                return value_at<int>(n, place);
            }
        }
        refuse("a missing command");
    }
    // Returns the place of the flags in a tag, and the tag's size: milltask copies the flags from behind the tag.
    std::pair<size_t, size_t> shape_of_tag(size_t place, int first) const {
        size_t flags = 0;
        const auto value = [&] { return value_at<int>(commands_.size() - 1, place + flags) - first; };
        while (place + flags + 2 * sizeof(int) <= length_ && value() == static_cast<int>(flags / sizeof(int))) {
            flags += sizeof(int);
        }
        return {flags, static_cast<size_t>(value()) * sizeof(int)};
    }
    int commands() const { return static_cast<int>(commands_.size()); }

    // Lets motion execute the last command.
    void execute() {
        unexecuted_.assign(memory_, memory_ + size_);
        thread::call("motion-command-handler");
    }
    // Returns the place to which motion has copied a value of the last command; 0 if it has not.
    size_t copied(double of_command, const char *what) const {
        const size_t from = place(of_command, what);
        size_t place = 0, count = 0;
        for (size_t at = 0; at + sizeof(double) <= size_; at += sizeof(double)) {
            if (at != from && value<double>(memory_, at) == of_command) {
                place = at;
                count++;
            }
        }
        if (count > 1) {
            refuse(what);
        }
        return place;
    }
    // Returns the place of the state behind another place that the last command has changed from 0 to this one.
    size_t entered(int state, size_t behind, const char *what) const {
        size_t place = 0, count = 0;
        for (size_t at = behind; at < behind + NEAR && at + sizeof(int) <= size_; at += sizeof(int)) {
            if (value<int>(unexecuted_.data(), at) == 0 && value<int>(memory_, at) == state) {
                place = at;
                count++;
            }
        }
        if (count != 1) {
            refuse(what);
        }
        return place;
    }

  private:
    template <typename T> static T value(const char *memory, size_t at) {
        T value;
        std::memcpy(&value, memory + at, sizeof value);
        return value;
    }
    template <typename T> T value_at(size_t command, size_t at) const {
        return value<T>(commands_[command].data(), at);
    }

    char *memory_;
    size_t size_, length_;
    std::vector<char> before_, unexecuted_;
    std::vector<std::vector<char>> commands_;
    std::vector<int> functions_;
    int values_ = 0;
};

// milltask's functions, as 2.9 and later versions declare them.
void line(const Pose &end, int kind, double feed, double fastest, int turn) {
    if (const auto call =
            found<int (*)(Pose, int, double, double, double, int)>("_Z17emcTrajLinearMove7EmcPoseidddi")) {
        call(end, kind, feed, fastest, 0.0, turn);
        return;
    }
    needed<int (*)(const Pose &, int, double, double, double, double, int)>("_Z17emcTrajLinearMoveRK7EmcPoseiddddi")(
        end, kind, feed, fastest, 0.0, 0.0, turn);
}
void circle(const Pose &end, const Vector &center, const Vector &normal, int turn) {
    if (const auto call = found<int (*)(Pose, const Vector &, const Vector &, int, int, double, double, double)>(
            "_Z19emcTrajCircularMove7EmcPose12PM_CARTESIANS0_iiddd")) {
        call(end, center, normal, turn, 0, 0.0, 0.0, 0.0);
        return;
    }
    needed<int (*)(const Pose &, const Vector &, const Vector &, int, int, double, double, double, double)>(
        "_Z19emcTrajCircularMoveRK7EmcPoseRK12PM_CARTESIANS4_iidddd")(end, center, normal, turn, 0, 0.0, 0.0, 0.0, 0.0);
}
void probe(const Pose &end) {
    if (const auto call =
            found<int (*)(Pose, int, double, double, double, unsigned char)>("_Z12emcTrajProbe7EmcPoseidddh")) {
        call(end, 0, 0.0, 0.0, 0.0, 0);
        return;
    }
    needed<int (*)(const Pose &, int, double, double, double, double, unsigned char)>(
        "_Z12emcTrajProbeRK7EmcPoseiddddh")(end, 0, 0.0, 0.0, 0.0, 0.0, 0);
}
void tap(const Pose &end, double scale) {
    if (const auto call = found<int (*)(Pose, double, double, double, double)>("_Z15emcTrajRigidTap7EmcPosedddd")) {
        call(end, 0.0, 0.0, 0.0, scale);
        return;
    }
    needed<int (*)(const Pose &, double, double, double, double, double)>("_Z15emcTrajRigidTapRK7EmcPoseddddd")(
        end, 0.0, 0.0, 0.0, 0.0, scale);
}
}

namespace layout {
Layout measure() {
    using Init = int (*)(const char *);
    const Init init = found<Init>("usrmotInit");
    (init ? init : needed<Init>("_Z10usrmotInitPKc"))("pkmkins");
    size_t size = 0;
    char *const memory = static_cast<char *>(memory::only(size));
    if (!memory) {
        refuse("its shared memory");
    }
    const auto set_id = needed<int (*)(int)>("_Z18emcTrajSetMotionIdi");
    const auto set_axes = needed<int (*)(int)>("_Z14emcTrajSetAxesi");
    const auto set_tag = needed<int (*)(const void *)>("_Z16emcTrajUpdateTagRK8StateTag");
    const auto set_condition = needed<int (*)(int, double)>("_Z18emcTrajSetTermCondid");
    const auto set_sync = needed<int (*)(int, double, bool)>("_Z21emcTrajSetSpindleSyncidb");
    using Limit = int (*)(int, double);
    const Limit limits[] = {needed<Limit>("_Z27emcJointSetMinPositionLimitid"),
                            needed<Limit>("_Z27emcJointSetMaxPositionLimitid"),
                            needed<Limit>("_Z26emcAxisSetMinPositionLimitid"),
                            needed<Limit>("_Z26emcAxisSetMaxPositionLimitid")};
    const auto start = needed<int (*)(int, double, double, double, int)>("_Z12emcSpindleOnidddi");
    const auto orient = needed<int (*)(int, double, int)>("_Z16emcSpindleOrientidi");
    const auto set_spindle =
        needed<int (*)(int, double, double, double, double, double, double, int, double)>("_Z19emcSpindleSetParamsiddddddid");
    enum { LINE, CIRCLE, PROBE, TAP, CONDITION, SYNC, JOINT, AXIS, START, ORIENT, SPINDLE };

    Layout layout;
    // milltask reports that nothing answers.
    const Silence silence;
    Bench bench(memory, size);

    const int id = bench.whole(), kind = bench.whole(), turn = bench.whole(), first = 0x7b000000;
    int tag[MOST_OF_TAG / sizeof(int)];
    for (size_t n = 0; n < sizeof tag / sizeof *tag; n++) {
        tag[n] = first + static_cast<int>(n);
    }
    set_id(id);
    set_tag(tag);
    const Pose end = bench.pose();
    const double feed = bench.number(), fastest = bench.number();
    line(end, kind, feed, fastest, turn);
    bench.sees(LINE);
    layout.id = bench.place(id, "id");
    layout.kind = bench.place(kind, "motion_type");
    layout.turn = bench.place(turn, "turn");
    layout.end = bench.places(end.values, "pos");
    layout.feed = bench.place(feed, "vel");
    layout.fastest = bench.place(fastest, "ini_maxvel");
    layout.tag = bench.place(first, "tag");
    const auto shape = bench.shape_of_tag(layout.tag, first);

    const Vector center = {{bench.number(), bench.number(), bench.number()}};
    const Vector normal = {{bench.number(), bench.number(), bench.number()}};
    const int turns = bench.whole();
    circle(bench.pose(), center, normal, turns);
    bench.sees(CIRCLE);
    layout.center = bench.places(center.values, "center");
    layout.normal = bench.places(normal.values, "normal");
    if (bench.place(turns, "turn") != layout.turn) {
        refuse("turn");
    }

    probe(bench.pose());
    bench.sees(PROBE);

    const double scale = bench.number();
    tap(bench.pose(), scale);
    bench.sees(TAP);
    layout.scale = bench.place(scale, "scale");

    const int condition = bench.whole();
    const double tolerance = bench.number();
    set_condition(condition, tolerance);
    bench.sees(CONDITION);
    layout.condition = bench.place(condition, "termCond");
    layout.tolerance = bench.place(tolerance, "tolerance");

    const int spindle = bench.whole();
    const double pitch = bench.number();
    for (const bool waits : {false, true, false}) {
        set_sync(spindle, pitch, waits);
        bench.sees(SYNC);
    }
    layout.waits = bench.toggled("flags");
    layout.spindle = bench.place(spindle, "spindle");
    layout.pitch = bench.place(pitch, "spindlesync");

    set_axes(1);
    for (int n = 0; n < 4; n++) {
        const double limit = bench.number();
        limits[n](0, limit);
        bench.sees(n < 2 ? JOINT : AXIS);
        size_t &place = n % 2 == 0 ? layout.low : layout.high;
        const size_t measured = bench.place(limit, n % 2 == 0 ? "minLimit" : "maxLimit");
        if (n >= 2 && measured != place) {
            refuse("limits of axes");
        }
        place = measured;
    }

    // milltask keeps its last command and limits: they are zero again.
    set_id(0);
    std::memset(tag, 0, sizeof tag);
    set_tag(tag);
    for (const Limit limit : limits) {
        limit(0, 0.0);
        bench.sees(limit == limits[0] || limit == limits[1] ? JOINT : AXIS);
    }
    set_axes(0);
    circle({}, {}, {}, 0);
    bench.sees(CIRCLE);
    tap({}, 0.0);
    bench.sees(TAP);
    set_condition(0, 0.0);
    bench.sees(CONDITION);
    set_sync(0, 0.0, false);
    bench.sees(SYNC);
    line({}, 0, 0.0, 0.0, 0);
    bench.sees(LINE);

    for (int n = 0;; n++) {
        const double speed = -bench.number(), factor = bench.number(), offset = bench.number();
        start(n, speed, factor, offset, 0);
        bench.sees(START);
        bench.execute();
        SpindlePlaces places = {};
        places.factor = bench.copied(factor, "css_factor");
        if (!places.factor) {
            break;
        }
        places.offset = bench.copied(offset, "xoffset");
        // The direction becomes -1.
        places.state = bench.entered(ON, places.factor, "the state of a spindle");
        // Before milltask starts, the limits of the speed are zero.
        set_spindle(n, 0.0, 0.0, 0.0, -FASTEST, 0.0, 0.0, 0, 0.0);
        bench.sees(SPINDLE);
        bench.execute();
        start(n, speed, factor, offset, 0);
        bench.sees(START);
        bench.execute();
        places.speed = bench.copied(speed, "the speed of a spindle");
        orient(n, 0.0, 0);
        bench.sees(ORIENT);
        bench.execute();
        places.orient = bench.entered(IN_PROGRESS, places.factor, "the orientation of a spindle");
        if (!places.offset || !places.speed) {
            refuse("the status of a spindle");
        }
        // Motion ends the orientation also in its pins.
        start(n, 0.0, 0.0, 0.0, 0);
        bench.sees(START);
        bench.execute();
        layout.spindles.push_back(places);
    }
    start(0, 0.0, 0.0, 0.0, 0);
    bench.sees(START);
    set_spindle(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0);
    bench.sees(SPINDLE);

    layout.code = bench.code();
    layout.line = bench.code_of(LINE, layout.code);
    layout.circle = bench.code_of(CIRCLE, layout.code);
    layout.probe = bench.code_of(PROBE, layout.code);
    layout.tap = bench.code_of(TAP, layout.code);
    layout.set_condition = bench.code_of(CONDITION, layout.code);
    layout.set_sync = bench.code_of(SYNC, layout.code);
    layout.joint_limits = bench.code_of(JOINT, layout.code);
    layout.axis_limits = bench.code_of(AXIS, layout.code);
    layout.commands = bench.commands();
    layout.memory = memory;

    if (layout.spindles.empty()) {
        refuse("the status of a spindle");
    }
    for (const Tag &shaped : TAGS) {
        if (shape == std::make_pair(shaped.flags, shaped.size)) {
            layout.of_tag = shaped;
            return layout;
        }
    }
    refuse("the tag of a move");
}

Spindle Layout::spindle_of(size_t n) const {
    const SpindlePlaces &at = spindles[n];
    // M19 stops the spindle, and in 2.9.0 without ending M3.
    const bool turns = field<int>(at.state) != 0 && field<int>(at.orient) == 0;
    return {field<double>(at.speed), field<double>(at.factor), field<double>(at.offset), turns};
}
}
