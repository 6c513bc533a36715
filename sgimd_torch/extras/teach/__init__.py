"""Teaching by hand: lead an arm, make a lesson of the recording, and show the lesson to a learner.

Sections 2.3 and 4.1 of Nguyen & Oudeyer (2014), kinesthetic teaching, on a simulated arm. `leading` moves the arm,
`lessons` makes lessons, `taught` is the run that is taught, and `page` is the page of `sgimd teach` in a browser.
"""

WORDS = """
command  command  teach
teacher  by_hand  by-hand=ByHand
"""
PUBLIC = """
leading  Leading
led      HandLed arm_led
taught   TaughtRun
"""
NEEDS = ("models", "recordings")
INSTALL = "teach"
