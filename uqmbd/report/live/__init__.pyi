"""The names of `uqmbd.report.live` and their modules, for type checkers and for lazy imports."""

from .explorer_data import collect_explorer_data as collect_explorer_data
from .explorer_data import collect_nearest_data as collect_nearest_data
from .page import PageScripts as PageScripts
from .page import cell_html as cell_html
from .page import joined_modules as joined_modules
from .page import page_scripts as page_scripts
from .player_data import collect_player_data as collect_player_data
from .poses import live_poses as live_poses
from .poses import packed_poses as packed_poses
from .poses import pose_surrogate as pose_surrogate
from .poses import with_poses as with_poses
from .surrogates import live_method as live_method
from .surrogates import live_surrogate as live_surrogate
from .surrogates import packed_surrogate as packed_surrogate
from .surrogates import shipped as shipped
