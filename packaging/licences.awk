# SPDX-License-Identifier: GPL-2.0-or-later
# Of what cargo-about writes: instead of a text that every Debian has, where it is, and its lines of copyright.
/^-+$/ { state = "" }
state == "list" && /^$/ {
    print "\nThe text is in /usr/share/common-licenses/Apache-2.0.\n"
    state = "text"
}
state == "text" && !/^ *Copyright [0-9(]/ { next }
/^Apache License 2\.0, of:$/ { state = "list" }
{ print }
