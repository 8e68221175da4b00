# Made by pkm panel from tripod.ini: what tripod-panel.xml shows.
if {[catch { source [file join $::env(HALLIB_DIR) pkmkins_panel.tcl] } error]} {
    catch { puts stderr "pkmkins: panel: not connected: $error" }
    return
}
pkmkins_panel::start tripod.ini {x y z}
pkmkins_panel::switch
pkmkins_panel::show {
    joint.0.pos-fb joint-0
    pkmkins.margin.0 margin-0
    joint.1.pos-fb joint-1
    pkmkins.margin.1 margin-1
    joint.2.pos-fb joint-2
    pkmkins.margin.2 margin-2
    pkmkins.base-angle.0 base-angle-0
    pkmkins.base-angle.1 base-angle-1
    pkmkins.base-angle.2 base-angle-2
    pkmkins-panel.x-minus x-minus
    pkmkins-panel.x-plus x-plus
    pkmkins-panel.y-minus y-minus
    pkmkins-panel.y-plus y-plus
    pkmkins-panel.z-minus z-minus
    pkmkins-panel.z-plus z-plus
    pkmkins-panel.known travel-known
    pkmkins.conditioning conditioning
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
}
