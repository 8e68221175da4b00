# Arms 180 long, rods 330.
loadrt $::KINS(KINEMATICS)
loadrt $::EMCMOT(EMCMOT) servo_period_nsec=$::EMCMOT(SERVO_PERIOD) num_joints=$::KINS(JOINTS)
foreach {pin key} {platformradius HUB_DIAMETER footradius FOOT_DIAMETER} {
    setp rotarydeltakins.$pin [set ::ARMS($key)]/2.0
}
foreach {signal value} {thigh 180 shin 330} {
    net $signal rotarydeltakins.${signal}length
    hal sets $signal $value
}
addf motion-command-handler servo-thread
addf motion-controller servo-thread
