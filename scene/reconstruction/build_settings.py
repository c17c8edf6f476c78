"""All settings of `scene-build`, stage by stage. Imports no numerics, so that `--help` answers at once."""

from __future__ import annotations

from dataclasses import dataclass, field

from materials.foundation.settings import check_settings, setting


@dataclass(frozen=True)
class CloudSettings:
    """What is kept of the sweeps."""

    ego_radius: float = setting(
        2.6, "returns nearer to the scanner than this, seen from above, are its own vehicle [m]", within="[0, 100]"
    )
    max_range: float = setting(80.0, "returns beyond this range are dropped [m]", within="(0, 10000]")
    voxel: float = setting(0.03, "points are thinned to one per cube of this size near the path [m]", within="[0.001, 10]")
    voxel_range: float = setting(
        8.0, "the size of the cubes doubles at this distance from the path, and at every doubling of it [m]", within="[0.1, 10000]"
    )
    stray_distance: float = setting(0.3, "a point whose 6th neighbour is further away than this is a stray [m]", within="(0, 1000]")
    stray_per_metre: float = setting(0.015, "and this much more per metre of range [1]", within="[0, 10]")
    stereo: bool = setting(True, "stereo fills what no scanner saw, where a second camera was recorded")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class DynamicsSettings:
    """What counts as moved."""

    mask_dilation: int = setting(
        3, "masks of moving objects are widened by this much before points are removed [px]", within="[0, 100]"
    )
    object_length: float = setting(
        8.0, "points this far behind the nearest point of a masked object still belong to it [m]", within="[0, 1000]"
    )
    box_motion: float = setting(
        0.5, "a 3-D box moves if its centre strays by more than this over the frames, unless its file says [m]", within="[0, 1000]"
    )
    box_margin: float = setting(0.15, "boxes of moving objects are widened by this before points are removed [m]", within="[0, 10]")
    free_space_margin: float = setting(
        0.3, "a beam must pass a point by this much to say that its place is free [m]", within="[0, 100]"
    )
    free_space_votes: int = setting(2, "sweeps that must have seen through a point before it is called moving", within="[1, 65535]")
    free_space_share: float = setting(0.2, "and their share among all sweeps that saw the place [0 to 1]", within="[0, 1]")
    free_space_range: float = setting(50.0, "beams beyond this range do not vote [m]", within="[0, 10000]")
    motion_masks: bool = setting(True, "what the sweeps saw move gets masks, where the recording has neither masks nor boxes")
    slow_traffic: bool = setting(True, "things that move from sweep to sweep go, though no beam sees through their place")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class GroundSettings:
    """How ground is told from the environment."""

    ground_cell: float = setting(0.4, "grid of lowest heights on which the ground is grown [m]", within="[0.02, 10]")
    ground_step: float = setting(0.17, "largest step within the ground, a kerb [m]", within="[0, 10]")
    ground_foot_step: float = setting(0.08, "largest step to ground below something taller [m]", within="[0, 10]")
    ground_step_per_metre: float = setting(0.03, "how much more a step may be per metre of gap in the data [1]", within="[0, 1]")
    ground_slope: float = setting(0.25, "steepest ground [1]", within="(0, 10]")
    ground_below: float = setting(0.12, "points this far below the ground are noise [m]", within="[0, 10]")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class HeightFieldSettings:
    """How the ground is fitted."""

    surface_cell: float = setting(0.1, "finest cell of the ground mesh [m]", within="[0.01, 10]")
    surface_near: float = setting(
        14.0, "distance from the path up to which cells are finest; they double at each doubling [m]", within="(0, 10000]"
    )
    surface_noise: float = setting(0.02, "standard deviation of a ground point's height [m]", within="(0, 10]")
    surface_stiffness: float = setting(10000.0, "resistance to bending [1/m^2 of squared slope change per m]", within="(0, 1e12]")
    surface_break: float = setting(
        0.0002,
        "a change of slope times cell from which on bending counts linearly: streets are planes with kerbs between [m]",
        within="(0, 1e6]",
    )
    hole_size: float = setting(2.0, "holes up to this width are closed near the path [m]", within="[0, 100]")
    hole_area: float = setting(25.0, "and enclosed holes, below parked vehicles, up to this area [m^2]", within="[0, 10000]")
    piece_area: float = setting(12.0, "pieces of ground smaller than this are dropped [m^2]", within="[0, 1e6]")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class SurfaceSettings:
    """How meshes are reconstructed."""

    ground_method: str = setting(
        "height-field", "ground by a height field, or by screened Poisson", choices=("height-field", "poisson")
    )
    ground_depth: int = setting(
        0, "octree depth of the ground's Poisson reconstruction (0 = by point spacing, at most 13)", within="[0, 13]"
    )
    environment_depth: int = setting(0, "octree depth of the environment's (0 = by point spacing, at most 12)", within="[0, 12]")
    environment_cell: float = setting(
        0.08, "no cell of the environment is finer: it is seen in reflections only [m]", within="[0.005, 10]"
    )
    normal_neighbours: int = setting(20, "neighbours for a normal", within="[3, 1000]")
    trim_density: float = setting(0.02, "share of the least supported vertices that is cut off [0 to 1]", within="[0, 1)")
    trim_distance: float = setting(
        4.0, "faces further from any point than this many times the local point spacing are cut off [1]", within="(0, 1e6]"
    )
    smallest_piece: int = setting(60, "pieces of the environment with fewer triangles are dropped", within="[0, 1e9]")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class CardboardSettings:
    """How moving objects become boards."""

    board_margin: float = setting(0.05, "boards reach this far beyond the mask [m]", within="[0, 10]")
    board_pixels: int = setting(40, "smaller masks give no board [px]", within="[1, 1e9]")
    board_range: float = setting(120.0, "boards further away than this are left out [m]", within="(0, 100000]")
    board_tilt_deg: float = setting(80.0, "largest angle between a vehicle's board and the image plane [deg]", within="[0, 90]")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class TerrainSettings:
    """Settings of `ground_maps`; the defaults of the puddles are the thesis's (eq 6.4), the mask's are of 6.3.3."""

    cell: float = setting(0.05, "size of a cell of the ground maps [m]", within="(0, 10]")
    mask_source: str = setting("auto", "where the wetness mask comes from", choices=("auto", "segmentation", "colour", "none"))
    mask_blur: float = setting(0.15, "sigma of the blur of the wetness mask [m]", within="[0, 100]")
    mask_hardly: float = setting(0.25, "M of ground that hardly gets wet: vegetation", within="[0, 1]")
    mask_seeps: float = setting(0.5, "M of ground where water seeps away: soil, open joints", within="[0, 1]")
    mask_holds: float = setting(1.0, "M of ground that water stays on: road, pavement", within="[0, 1]")
    puddle_scale: float = setting(2.0, "largest size of the puddle pattern [m]", within="(0, 1000]")
    puddle_exponent: float = setting(4.0, "beta of the 1/f^beta puddle pattern", within="[0, 20]")
    puddle_contrast: float = setting(4.0, "contrast of the puddle pattern", within="[0, 1000]")
    puddle_offset: float = setting(-0.25, "offset of the puddle pattern after the contrast", within="[-1000, 1000]")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class SkySettings:
    """Settings of `sky_panorama`; `model="thesis"` gives its generic sky of 0 to 1 in display units."""

    texel_deg: float = setting(0.25, "size of a texel of the sky panorama [deg]", within="[0.05, 15]")
    model: str = setting(
        "measured",
        "brightness of the unseen sky: measured on the sky that is seen, or 1 as in the thesis",
        choices=("measured", "thesis"),
    )
    full_elevation_deg: float = setting(15.0, "elevation above which the generic sky has its full radiance [deg]", within="(0, 90]")
    fill_deg: float = setting(3.0, "how far the seen sky is continued into the unseen, fading out [deg]", within="[0, 90]")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class BuildSettings:
    """All stages; in a TOML file each is a table of its name."""

    seed: int = setting(0, "seed of all that is random", within="[0, 4294967295]")
    cloud: CloudSettings = field(default_factory=CloudSettings)
    dynamics: DynamicsSettings = field(default_factory=DynamicsSettings)
    ground: GroundSettings = field(default_factory=GroundSettings)
    height_field: HeightFieldSettings = field(default_factory=HeightFieldSettings)
    surface: SurfaceSettings = field(default_factory=SurfaceSettings)
    cardboards: CardboardSettings = field(default_factory=CardboardSettings)
    terrain: TerrainSettings = field(default_factory=TerrainSettings)
    sky: SkySettings = field(default_factory=SkySettings)

    def __post_init__(self) -> None:
        check_settings(self)
