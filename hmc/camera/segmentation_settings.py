"""Parameters of the segmentation."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hmc.errors import InputError

__all__ = ["SegmentationSettings"]


@dataclass(frozen=True)
class SegmentationSettings:
    """Parameters of the segmentation. Sizes in pixels are for 640 x 480 and scale with the image.

    "Measured" means: overlap of masks and strict hulls with the true ones, on four rendered recordings of people in easy and in hard
    clothes (pale before pale walls, grey on a grey floor).

    Attributes
    ----------
    variance_threshold : float
        Squared distance to a mixture's Gaussian, in variances, beyond which a pixel is foreground. OpenCV's default is 16;
        9 loses fewer pale limbs (measured).
    shadow_factor : float
        A pixel is shadow where it is the background, darkened to no less than this share. OpenCV's default is .5; .6 keeps more dark
        clothes (measured).
    gap_threshold, gap_shadow_factor : float
        Standard deviations, and shadow factor, of the weaker evidence that fills gaps and bays of what the mixture found (measured).
    grey_shadow_factor, grey_gap_shadow_factor : float
        Shadow factors for images without color. There a shadow looks like anything darker: most shadows are lighter than .7, and
        with the factors for color a third of the people goes with them (measured).
    reach_threshold : float
        Standard deviations of the evidence that lets a silhouette grow outwards a little (measured).
    halo_share : float
        A pixel of the outline stays where its contrast is at least this share of the person's beside it; 0 cuts nothing (measured).
    least_blob_px : int
        Pieces in which the mixture found fewer pixels are specks.
    learning_rate, learn_every : float, int
        Share of a new image in the background each time it learns, and frames from one time to the next. At 30 frames a second the
        defaults follow the light with a time constant of 7 s, at 10 with one of 20 s; at fewer see `at_rate`.
    keep_out_px : int
        Nothing is learnt this near to a person, nor in shadows.
    max_foreground : float
        Share of the image beyond which the foreground cannot be people: a light was switched.
    least_chance : float
        How likely a pixel near people that may as well be a shadow must be a person to stay (`hmc.camera.shade`); 0: nobody is asked.
    """

    variance_threshold: float = 9.0
    shadow_factor: float = 0.6
    gap_threshold: float = 4.0
    gap_shadow_factor: float = 0.7
    grey_shadow_factor: float = 0.7
    grey_gap_shadow_factor: float = 0.85
    reach_threshold: float = 5.0
    halo_share: float = 0.4
    least_blob_px: int = 40
    learning_rate: float = 0.05
    learn_every: int = 10
    keep_out_px: int = 12
    max_foreground: float = 0.5
    least_chance: float = 0.4

    def __post_init__(self) -> None:
        factors = ("shadow_factor", "gap_shadow_factor", "grey_shadow_factor", "grey_gap_shadow_factor")
        for name in (*factors, "halo_share", "learning_rate", "max_foreground", "least_chance"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"segmentation: `{name}` must lie between 0 and 1; got {getattr(self, name)}")
        for name in ("variance_threshold", "gap_threshold", "reach_threshold", "learn_every"):
            if not getattr(self, name) > 0:
                raise InputError(f"segmentation: `{name}` must be positive; got {getattr(self, name)}")

    def at_rate(self, fps: float) -> SegmentationSettings:
        """The same for so many frames a second: the background learns once a second at least, or daylight would outrun it.

        Parameters
        ----------
        fps : float
        """
        return replace(self, learn_every=min(self.learn_every, max(1, round(fps))))
