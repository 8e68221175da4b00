# The operator's panel, which sets nothing of the kinematics.
from machinekit import hal
hal.newsig('panel-ok', hal.HAL_BIT)
