loadrt $::KINS(KINEMATICS)
loadrt $::EMCMOT(EMCMOT) servo_period_nsec=$::EMCMOT(SERVO_PERIOD) num_joints=$::KINS(JOINTS)

proc anchor {pin i radius degrees z} {
    set angle [expr {$degrees * acos(-1) / 180}]
    setp genhexkins.$pin.$i.x $radius*cos($angle)
    setp genhexkins.$pin.$i.y $radius*sin($angle)
    setp genhexkins.$pin.$i.z $z
}

lassign [lindex $::CIRCLES(BASE) 0] base half
lassign [lindex $::CIRCLES(PLATFORM) 0] platform other
for {set i 0} {$i < 6} {incr i} {
    set side [expr {$i % 2 ? 1 : -1}]
    set middle [expr {120 * ($i / 2)}]
    anchor base $i $base [expr {$middle + $side * $half}] [lindex $::CIRCLES(HEIGHT) 0]
    anchor platform $i $platform [expr {$middle + $side * (60 - $other)}] 0
}
addf motion-command-handler servo-thread
addf motion-controller servo-thread
