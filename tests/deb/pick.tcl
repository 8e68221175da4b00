# SPDX-License-Identifier: GPL-2.0-or-later
# Selects a machine in LinuxCNC's configuration selector, in place of a user.
#
#     wish pick.tcl PICKER INI     prints the output of the selector: the INI file of the copy
#
# Standard error gets the text that the selector shows about the machine.
lassign $argv picker wanted
set argv {}
# Answers Yes to the question whether to copy, and OK to the message with the path of the copy.
proc tk_dialog {args} { return 0 }
proc pick {} {
    if {![info exists ::button_ok] || ![$::tree exists $::wanted]} {
        if {[incr ::looks] > 300} {
            puts stderr "pick.tcl: the picker does not offer $::wanted"
            exit 1
        }
        after 100 pick
        return
    }
    $::tree selection set $::wanted
    node_clicked
    puts stderr [$::detail_box get 1.0 end]
    press
}
# Repeats the press: the selector may not be waiting for the button yet.
proc press {} {
    $::button_ok invoke
    after 500 press
}
after 100 pick
source $picker
