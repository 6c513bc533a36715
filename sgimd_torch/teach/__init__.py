"""Teaching by hand: lead an arm, turn the recording into a lesson, show it to a learner, also on a page in a browser.

Sections 2.3 and 4.1 of Nguyen & Oudeyer (2014), kinesthetic teaching, on a simulated arm. `leading` moves the arm,
`lessons` makes lessons, `taught` is the run that is taught, `page` the page of `sgimd teach`. Nothing outside this
folder imports it; the catalogue names its teacher.
"""
