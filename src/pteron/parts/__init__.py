"""Parts that machines are built of, from lists: motors, gearboxes, screws, belts, joints, guides.

The lists in this folder are examples: values of ordinary parts, as data sheets of several makers
have them on average, with prices of their order of magnitude. Motors are `pteron.motion.Motor`.
"""
