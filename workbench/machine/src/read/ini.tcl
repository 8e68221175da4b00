# SPDX-License-Identifier: GPL-2.0-or-later
# An INI file as LinuxCNC's haltcl reads it, whose own package would attach to the HAL of this computer: the
# section, key and value of every line KEY = VALUE, one after another.
proc ini_values {ini} {
    set found {}
    set file [open $ini]
    while {[gets $file line] >= 0} {
        # Without regular expressions, which take five times as long.
        set line [string trim $line]
        if {[string match {\[*\]} $line]} {
            set section [string range $line 1 end-1]
            continue
        }
        set at [string first = $line]
        set key [string trimright [string range $line 0 $at-1]]
        if {$key eq "" || [string first # $key] >= 0} { continue }
        lappend found $section $key [string trimleft [string range $line $at+1 end]]
    }
    close $file
    return $found
}
