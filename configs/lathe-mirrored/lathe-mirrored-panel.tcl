# Made by pkm panel from lathe-mirrored.ini: what lathe-mirrored-panel.xml shows.
if {[catch { source [file join $::env(HALLIB_DIR) pkmkins_panel.tcl] } error]} {
    catch { puts stderr "pkmkins: panel: not connected: $error" }
    return
}
pkmkins_panel::start lathe-mirrored.ini {x y z b c u v w}
pkmkins_panel::switch
pkmkins_panel::show {
    joint.0.pos-fb joint-0
    pkmkins.margin.0 margin-0
    joint.1.pos-fb joint-1
    pkmkins.margin.1 margin-1
    joint.2.pos-fb joint-2
    pkmkins.margin.2 margin-2
    joint.3.pos-fb joint-3
    pkmkins.margin.3 margin-3
    joint.4.pos-fb joint-4
    pkmkins.margin.4 margin-4
    joint.5.pos-fb joint-5
    pkmkins.margin.5 margin-5
    joint.6.pos-fb joint-6
    pkmkins.margin.6 margin-6
    joint.7.pos-fb joint-7
    pkmkins.margin.7 margin-7
    pkmkins.base-angle.0 base-angle-0
    pkmkins.base-angle.1 base-angle-1
    pkmkins.base-angle.2 base-angle-2
    pkmkins.base-angle.3 base-angle-3
    pkmkins.base-angle.4 base-angle-4
    pkmkins.base-angle.5 base-angle-5
    pkmkins.base-angle.6 base-angle-6
    pkmkins.base-angle.7 base-angle-7
    pkmkins-panel.x-minus x-minus
    pkmkins-panel.x-plus x-plus
    pkmkins-panel.y-minus y-minus
    pkmkins-panel.y-plus y-plus
    pkmkins-panel.z-minus z-minus
    pkmkins-panel.z-plus z-plus
    pkmkins-panel.b-minus b-minus
    pkmkins-panel.b-plus b-plus
    pkmkins-panel.c-minus c-minus
    pkmkins-panel.c-plus c-plus
    pkmkins-panel.u-minus u-minus
    pkmkins-panel.u-plus u-plus
    pkmkins-panel.v-minus v-minus
    pkmkins-panel.v-plus v-plus
    pkmkins-panel.w-minus w-minus
    pkmkins-panel.w-plus w-plus
    pkmkins-panel.known travel-known
    pkmkins.conditioning conditioning
    pkmkins.second.conditioning conditioning-second
    pkmkins.feed-scale feed-scale
    pkmkins.jog-scale jog-scale
    pkmkins-panel.guard-on guard-on
    pkmkins.limit-soon limit-soon
    pkmkins.feed-inhibit feed-inhibit
    pkmkins.tool-busy tool-busy
    kinstype.is-0 is-machine
    kinstype.is-1 is-joints
    pkmkins.geometry-ok geometry-ok
    pkmkins.geometry-changed geometry-changed
    pkmkins.geometry-hash geometry-hash
    pkmkins.second.geometry-ok geometry-ok-second
    pkmkins.second.geometry-changed geometry-changed-second
    pkmkins.second.geometry-hash geometry-hash-second
}
