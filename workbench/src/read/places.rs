// SPDX-License-Identifier: GPL-2.0-or-later
//! Where LinuxCNC is on this computer, as Debian's packages have it.

/// HAL files that every machine may use: `LIB:` in an INI file.
pub const HALLIB: &str = "/usr/share/linuxcnc/hallib";
/// Modules of the real-time part.
pub const MODULES: &str = "/usr/lib/linuxcnc/modules";
/// Programs.
pub const BIN: &str = "/usr/bin";
