# A panel's HAL file as `pkm panel` writes it.
if {[catch { source [file join $::env(HALLIB_DIR) pkmkins_panel.tcl] } error]} {
    catch { puts stderr "pkmkins: panel: not connected: $error" }
    return
}
pkmkins_panel::start machine.ini {x c}
pkmkins_panel::switch
pkmkins_panel::show {
    joint.0.pos-fb joint-0
    pkmkins.margin.0 margin-0
    pkmkins-panel.x-minus x-minus
    pkmkins-panel.known travel-known
}
