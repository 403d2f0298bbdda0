"""Channels: what was measured, and what a simulation says of it. A residual is a stack of them.

A channel of a new kind: a final class in a file of its own that fulfils `channel.Channel`, and one line in
`stack.channels_of`. It needs no compliance: a rigid robot has poses too.
"""

from .channel import Channel, Columns
from .linear import Linear
from .noise import Noise
from .pose import PoseChannel
from .stack import Stack, channels_of, whitening
from .stations import Placing, Stations
