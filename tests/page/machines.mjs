// SPDX-License-Identifier: GPL-2.0-or-later
// Machines for tests only, as texts of INI files.

/** Returns an INI file of legs, with limits about their values at home. */
function iniOf(kinematics, letters, home, legs) {
  const section = (name, keys) => `[${name}]\n${Object.entries(keys).map(([key, value]) => `${key} = ${value}`).join("\n")}\n`;
  const motion = { MAX_VELOCITY: 100, MAX_ACCELERATION: 1000, FERROR: 5, MIN_FERROR: 1 };
  return [
    section("EMC", { MACHINE: "own" }), section("PKM", { SCREW_LEAD: 0 }), section("EMCMOT", { SERVO_PERIOD: 1000000 }),
    section("KINS", { KINEMATICS: kinematics, JOINTS: legs.length }),
    section("TRAJ", { COORDINATES: letters, HOME: home.join(" "), LINEAR_UNITS: "mm", ANGULAR_UNITS: "degree", MAX_LINEAR_VELOCITY: 100, MAX_LINEAR_ACCELERATION: 1000, MAX_ANGULAR_VELOCITY: 20, MAX_ANGULAR_ACCELERATION: 100 }),
    ...legs.map(({ keys }, i) => section(`LEG_${i}`, keys)),
    ...legs.map(({ keys, home }, i) => section(`JOINT_${i}`, { TYPE: keys.ARM ? "ANGULAR" : "LINEAR", HOME: home, MIN_LIMIT: home - 150, MAX_LIMIT: home + 150, ...motion })),
    ...[...letters].map((letter) => {
      const k = "XYZABC".indexOf(letter);
      const reach = k < 3 ? 50 : 10;
      return section(`AXIS_${letter}`, { MIN_LIMIT: home[k] - reach, MAX_LIMIT: home[k] + reach, ...motion });
    }),
  ].join("\n");
}

const strut = (base, platform, [x, y, z]) => ({
  keys: { BASE: base.join(" "), PLATFORM: platform.join(" ") },
  home: Math.hypot(base[0] - platform[0] - x, base[1] - platform[1] - y, base[2] - platform[2] - z),
});

/** Returns machines with uncommon legs, each an INI file. */
export function ownMachines() {
  const place = [0, 0, -300];
  const around = (radius, degrees, z = 0) => [radius * Math.cos((degrees * Math.PI) / 180), radius * Math.sin((degrees * Math.PI) / 180), z];
  const five = [0, 65, 140, 220, 300].map((angle, i) => strut(around(320, angle), around(90, angle + (i % 2 ? 35 : -25), i % 2 ? 60 : 0), place));
  const slider = { keys: { BASE: "260 -150 0", PLATFORM: "35 -20 0", GUIDE: "0 0 1", ROD: 420, SIDE: 1 }, home: 30 };
  const crank = { keys: { BASE: "-200 -115.47 0", PLATFORM: "-35 -20 0", AXIS: "0.5 -0.8660254 0", ARM: "-103.92 -60 0", ROD: 380, SIDE: -1 }, home: 20 };
  return {
    "five-struts": iniOf("pkmkins legs=strut:5 coordinates=XYZAB", "XYZAB", [...place, 0, 0, 0], five),
    "mixed-legs": iniOf("pkmkins legs=strut:1,slider:1,crank:1 coordinates=XYZ", "XYZ", [...place, 0, 0, 0], [strut([0, 300, 0], [0, 40, 0], place), slider, crank]),
  };
}

/** Returns machines whose axes carry work, tool and legs, each an INI file. */
export function carrying() {
  const { "five-struts": five, "mixed-legs": mixed } = ownMachines();
  const axis = (letter, place, carries, direction, point) => [
    `[JOINT_${place}]\nTYPE = ${"ABC".includes(letter) ? "ANGULAR" : "LINEAR"}\nHOME = 0\nMIN_LIMIT = -180\nMAX_LIMIT = 180\nMAX_VELOCITY = 100\nMAX_ACCELERATION = 1000`,
    `[AXIS_${letter}]\nMIN_LIMIT = -180\nMAX_LIMIT = 180\nMAX_VELOCITY = 100\nMAX_ACCELERATION = 1000`,
    `[CHAIN_${letter}]\nCARRIES = ${carries}\nAXIS = ${direction}${point ? `\nPOINT = ${point}` : ""}`,
  ].join("\n");
  const withAxes = (text, letters, axes) => {
    const count = Number(text.match(/JOINTS = (\d+)/)[1]);
    const world = text.match(/^COORDINATES = (.*)$/m)[1];
    return [
      text.replace(/JOINTS = \d+/, `JOINTS = ${count + letters.length}`)
        .replace(/(KINEMATICS = .*)/, `$1 axes=${letters}`).replace(/^COORDINATES = .*$/m, `COORDINATES = ${world}${letters}`)
        .replace(/^HOME = (\S+ \S+ \S+ \S+ \S+ \S+)$/m, "HOME = $1 0 0 0"),
      ...[...letters].map((letter, n) => axis(letter, count + n, ...axes[n])),
    ].join("\n");
  };
  const track = withAxes(five, "CUVW", [["WORK", "0.6 0 0.8", "10 -20 30"], ["LEGS", "1 2 0"], ["TOOL", "0 0 -1"], ["WORK", "0 1 0"]]);
  const held = withAxes(mixed, "ABCW", [["LEGS", "1 0 0", "0 50 -100"], ["TOOL", "0 1 0", "30 0 5"], ["WORK", "0 0 1", "5 6 7"], ["TOOL", "1 1 0"]]);
  return { "carried-legs": track, "carried-tool": held, "carried-work": held.replace("[PKM]\n", "[PKM]\nWORK_ON_PLATFORM = 20 30 -450\n") };
}
