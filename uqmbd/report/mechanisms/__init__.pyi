"""The names of `uqmbd.report.mechanisms` and their modules, for type checkers and for lazy imports."""

from .animation import SECONDS as SECONDS
from .animation import animate as animate
from .animation import check_target as check_target
from .animation import gif as gif
from .animation import integrated_poses as integrated_poses
from .animation import marked_points as marked_points
from .animation import motion as motion
from .animation import moved_axes as moved_axes
from .animation import observed_bodies as observed_bodies
from .animation import pose_names as pose_names
from .animation import poses as poses
from .animation import with_motion as with_motion
from .body_poses import drawn_pose as drawn_pose
from .body_poses import motion_at as motion_at
from .body_poses import stated_pose as stated_pose
from .deformation import magnification as magnification
from .film import Film as Film
from .pose_data import PoseData as PoseData
from .sketch import CLOSED as CLOSED
from .sketch import Sketch as Sketch
from .sketch import world as world
from .still_picture import draw_named as draw_named
from .still_picture import draw_pose as draw_pose
from .still_picture import mechanism as mechanism
from .still_picture import still as still
from .symbols import Stroke as Stroke
