#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Provides the pins of the hexapod-sim sample's graphic model and panel, without their windows."""

import signal

import hal

PINS = (
    [(f"hexagui.{stem}", hal.HAL_FLOAT, hal.HAL_IN)
     for stem in [f"joint.{n}" for n in range(6)] + [f"axis.{letter}" for letter in "xyzabc"]]
    + [(f"pyvcp.joint{n}", hal.HAL_FLOAT, hal.HAL_IN) for n in range(6)]
    + [(f"pyvcp.type{n}-button", hal.HAL_BIT, hal.HAL_OUT) for n in range(3)]
    + [(f"pyvcp.multilabel.0.legend{n}", hal.HAL_BIT, hal.HAL_IN) for n in range(3)]
    + [("pyvcp.fwd-kins-fail", hal.HAL_BIT, hal.HAL_IN),
       ("pyvcp.last-iter", hal.HAL_U32, hal.HAL_IN),
       ("pyvcp.max-iter", hal.HAL_U32, hal.HAL_IN),
       ("pyvcp.vismach-clear", hal.HAL_BIT, hal.HAL_OUT),
       ("vismach.plotclear", hal.HAL_BIT, hal.HAL_IN)]
)


def component(prefix):
    made = hal.component(prefix)
    for name, kind, direction in PINS:
        stem, _, rest = name.partition(".")
        if stem == prefix:
            made.newpin(rest, kind, direction)
    made.ready()
    return made


def main():
    kept = [component(prefix) for prefix in ("pyvcp", "vismach", "hexagui")]
    signal.pause()
    return kept


if __name__ == "__main__":
    main()
