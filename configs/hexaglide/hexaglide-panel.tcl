# Made by pkm panel from hexaglide.ini: what hexaglide-panel.xml shows.
if {[catch { source [file join $::env(HALLIB_DIR) pkmkins_panel.tcl] } error]} {
    catch { puts stderr "pkmkins: panel: not connected: $error" }
    return
}
pkmkins_panel::start hexaglide.ini {x y z a b c}
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
    pkmkins.base-angle.0 base-angle-0
    pkmkins.base-angle.1 base-angle-1
    pkmkins.base-angle.2 base-angle-2
    pkmkins.base-angle.3 base-angle-3
    pkmkins.base-angle.4 base-angle-4
    pkmkins.base-angle.5 base-angle-5
    pkmkins-panel.x-minus x-minus
    pkmkins-panel.x-plus x-plus
    pkmkins-panel.y-minus y-minus
    pkmkins-panel.y-plus y-plus
    pkmkins-panel.z-minus z-minus
    pkmkins-panel.z-plus z-plus
    pkmkins-panel.a-minus a-minus
    pkmkins-panel.a-plus a-plus
    pkmkins-panel.b-minus b-minus
    pkmkins-panel.b-plus b-plus
    pkmkins-panel.c-minus c-minus
    pkmkins-panel.c-plus c-plus
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
