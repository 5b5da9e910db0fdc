"""Pinhole cameras with radial and tangential distortion, one or a rig of many, over arrays of points.

Frames: world (metres, Z up), camera (x right, y down, z forward; ``x_cam = R x_world + t``), pixels ((u, v), the centre of
the top-left pixel at (0, 0)). Source: Canton (2009), section 2.2.2 and 6.4.1.2, with the distortion of Eq. 2.6-2.8 read as
``1 + k1 r^2 + k2 r^4`` in normalised coordinates; the remaining terms are OpenCV's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hmc.errors import InputError

__all__ = ["Camera", "Rig", "backproject", "look_at", "project", "undistort"]

#: Points nearer than this to the camera's plane (metres) count as behind it.
NEAR_M = 1e-6
#: No image is larger than this on a side.
MAX_SIDE_PX = 100_000
#: Radians: no vector of a rotation is longer, one in degrees nearly always.
LONGEST_TURN = 2 * np.pi + 1e-3
#: Pixels, coefficients and places (of any unit) are no larger.
MAX_NUMBER = 1e12


@dataclass(frozen=True, eq=False)
class Camera:
    """One calibrated camera.

    Parameters
    ----------
    name : str
        Name, as in file names (``cam_00``).
    size : tuple of int
        (width, height) in pixels.
    matrix : ndarray, shape (3, 3)
        Intrinsic matrix K.
    distortions : ndarray, shape (5,)
        k1, k2, p1, p2, k3 in OpenCV's model. Four values or fewer are padded with zeros; OpenCV's longer models (8, 12 or 14 values) are
        taken where what follows k3 is zero.
    rotation : ndarray, shape (3, 3)
        World to camera. A rotation vector (Rodrigues; 3, 3 x 1 or 1 x 3) is accepted too.
    translation : ndarray, shape (3,)
        World to camera, metres.

    Raises
    ------
    InputError
        When a shape is wrong, a number is not finite or the rotation is not one.

    Examples
    --------
    What ``cv2.calibrateCamera`` and ``cv2.solvePnP`` return is taken as it is:

    >>> import numpy as np
    >>> matrix, rvec, tvec = np.array([[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]), np.zeros((3, 1)), np.array([[0.0], [0.0], [4.0]])
    >>> Camera("cam_00", [640, 480], matrix, np.zeros((1, 5)), rvec, tvec).centre
    array([ 0.,  0., -4.])
    """

    name: str
    size: tuple[int, int]
    matrix: np.ndarray
    distortions: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray

    def __post_init__(self) -> None:
        def say(what: str) -> InputError:
            return InputError(f"camera '{self.name}': {what}")

        def array(label: str) -> np.ndarray:
            try:
                return np.array(getattr(self, label), float)
            except (ValueError, TypeError, OverflowError):
                raise say(f"`{label}` must be numbers; got {str(getattr(self, label))[:60]!r}") from None

        if not self.name.strip(".") or not self.name.isprintable() or set(self.name) & set("/\\"):
            raise say("a name must be a file's too: neither empty nor dots alone, without / and \\; name the camera otherwise")
        sides = array("size").ravel()
        if sides.shape != (2,) or not np.all(np.isfinite(sides)) or sides.min() < 1 or sides.max() > MAX_SIDE_PX:
            raise say(f"`size` must be [width, height] in pixels; got {sides.tolist()}")
        size = (round(float(sides[0])), round(float(sides[1])))
        matrix = array("matrix")
        if matrix.shape != (3, 3):
            raise say(f"`matrix` must be 3 x 3; got shape {matrix.shape}")
        distortions = array("distortions").ravel()
        if distortions[5:].any():
            raise say(
                f"`distortions` takes k1, k2, p1, p2 and k3; got {distortions.size} numbers, with {_beyond_k3(distortions)}: calibrate "
                "without those terms"
            )
        distortions = np.pad(distortions[:5], (0, max(0, 5 - distortions.size)))
        rotation = array("rotation")
        if rotation.size == 3:
            if LONGEST_TURN < np.abs(rotation).max() < np.inf:
                raise say(
                    f"`rotation` is a vector with {np.abs(rotation).max():.4g} in it, more than a full turn; give it in radians (is it in "
                    "degrees?)"
                )
            rotation = _rotation_from_vector(rotation.ravel())
        if rotation.shape != (3, 3):
            raise say(f"`rotation` must be a rotation vector (3) or a matrix (3 x 3); got shape {rotation.shape}")
        translation = array("translation").ravel()
        if translation.shape != (3,):
            raise say(f"`translation` must be 3 numbers in metres; got {translation.size}")
        for label, value in (("matrix", matrix), ("distortions", distortions), ("rotation", rotation), ("translation", translation)):
            if not np.all(np.isfinite(value)):
                raise say(f"`{label}` holds a number that is not finite; calibrate this camera again or leave it out")
            if np.abs(value).max(initial=0.0) > MAX_NUMBER:
                raise say(f"`{label}` holds {np.abs(value).max():g}, which no camera has; calibrate it again or leave it out")
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or abs(matrix[2, 2] - 1) > 1e-6 or np.abs(matrix[[1, 2, 2], [0, 0, 1]]).max() > 1e-6:
            raise say("`matrix` is no intrinsic matrix [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with positive focal lengths")
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0:
            raise say("`rotation` is not a rotation (its rows must be orthonormal and right-handed)")
        object.__setattr__(self, "size", size)
        for label, value in (("matrix", matrix), ("distortions", distortions), ("rotation", rotation), ("translation", translation)):
            value.setflags(write=False)
            object.__setattr__(self, label, value)

    @property
    def centre(self) -> np.ndarray:
        """Camera centre in the world, shape (3,), metres."""
        return -self.rotation.T @ self.translation

    @property
    def projection(self) -> np.ndarray:
        """``P = K [R | t]``, shape (3, 4); without distortion."""
        return self.matrix @ np.column_stack([self.rotation, self.translation])

    @cached_property
    def max_radius(self) -> float:
        """Largest undistorted radius (normalised coordinates) up to which the distortion is one-to-one.

        A strong negative k1 folds far-away rays back into the image; points beyond this radius are never in view.
        """
        # What is too small to matter anywhere in an image would only upset the solver.
        k1, k2, _, _, k3 = np.where(np.abs(self.distortions) < 1e-9, 0.0, self.distortions)
        roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])  # of d/dr (r + k1 r^3 + k2 r^5 + k3 r^7), in r^2
        real = roots[np.abs(roots.imag) < 1e-9].real if roots.size else roots
        real = real[real > 0]
        return float(np.sqrt(real.min())) if real.size else np.inf

    def scaled(self, factor: float) -> Camera:
        """The same camera for images resized by ``factor`` (pixel centres on integers).

        Returns
        -------
        Camera
            With ``size`` rounded to whole pixels.
        """
        matrix = np.array(self.matrix)
        matrix[:2, 2] += 0.5
        matrix[:2] *= factor
        matrix[:2, 2] -= 0.5
        width, height = self.size
        return replace(self, size=(max(1, round(width * factor)), max(1, round(height * factor))), matrix=matrix)


@dataclass(frozen=True, eq=False)
class Rig:
    """Calibrated cameras that look at one room, in order. Behaves as a sequence of `Camera`."""

    cameras: tuple[Camera, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "cameras", tuple(self.cameras))
        names = [camera.name for camera in self.cameras]
        if not names:
            raise InputError("a rig needs at least one camera")
        if len(set(names)) != len(names):
            raise InputError(f"camera names must differ; got {names}")

    def __len__(self) -> int:
        return len(self.cameras)

    def __iter__(self):
        return iter(self.cameras)

    def __getitem__(self, index):
        return self.cameras[index]

    @property
    def names(self) -> tuple[str, ...]:
        """Camera names, in order."""
        return tuple(camera.name for camera in self.cameras)

    @property
    def centres(self) -> np.ndarray:
        """Camera centres in the world, shape (n_cameras, 3), metres."""
        return np.array([camera.centre for camera in self.cameras])

    def select(self, names) -> Rig:
        """The rig of the named cameras, in the order given.

        Raises
        ------
        InputError
            When a name is not in the rig.
        """
        by_name = {camera.name: camera for camera in self.cameras}
        missing = [name for name in names if name not in by_name]
        if missing:
            raise InputError(f"no camera named {missing[0]!r}; the rig has {', '.join(self.names)}")
        return Rig(tuple(by_name[name] for name in names))


def project(cameras: Camera | Rig, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project world points into one camera or into every camera of a rig.

    Parameters
    ----------
    cameras : Camera or Rig
    points : ndarray, shape (..., 3)
        World, metres.

    Returns
    -------
    uv : ndarray, shape (..., 2), or (n_cameras, ..., 2) for a rig
        Pixels; of no meaning where not valid.
    valid : ndarray of bool, shape (...), or (n_cameras, ...)
        In front of the camera and inside the one-to-one range of its distortion. The image's border is not considered.
    """
    if isinstance(cameras, Rig):
        pairs = [project(camera, points) for camera in cameras]
        return np.stack([uv for uv, _ in pairs]), np.stack([valid for _, valid in pairs])
    points = np.asarray(points, float)
    turned = points @ cameras.rotation.T
    # Coordinate by coordinate: NumPy is slow along axes of two or three.
    x, y, depth = (turned[..., k] + cameras.translation[k] for k in range(3))
    front = depth > NEAR_M
    depth = np.where(front, depth, 1.0)
    x, y = x / depth, y / depth
    valid = front & (x * x + y * y < cameras.max_radius**2)
    xy = np.empty((*points.shape[:-1], 2))
    xy[..., 0], xy[..., 1] = _distorted(cameras, np.where(valid, x, 0.0), np.where(valid, y, 0.0))
    uv = xy @ cameras.matrix[:2, :2].T
    uv[..., 0] += cameras.matrix[0, 2]
    uv[..., 1] += cameras.matrix[1, 2]
    return uv, valid


def distort(camera: Camera, xy: np.ndarray) -> np.ndarray:
    """Distort normalised image coordinates, (..., 2) to (..., 2)."""
    if not camera.distortions.any():
        return xy
    return np.stack(_distorted(camera, xy[..., 0], xy[..., 1]), axis=-1)


def _distorted(camera: Camera, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`distort` of x and y apart."""
    k1, k2, p1, p2, k3 = camera.distortions
    if not camera.distortions.any():
        return x, y
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y


def undistort(camera: Camera, uv: np.ndarray, iterations: int = 30) -> np.ndarray:
    """Pixels to undistorted normalised coordinates, by Newton's iteration on the distortion.

    Parameters
    ----------
    camera : Camera
    uv : ndarray, shape (..., 2)
        Pixels.
    iterations : int
        Most Newton steps; it stops when every point has converged.

    Returns
    -------
    ndarray, shape (..., 2)
        (x / z, y / z) in the camera's frame.
    """
    uv = np.asarray(uv, float)
    target = (uv - camera.matrix[:2, 2]) @ np.linalg.inv(camera.matrix[:2, :2]).T
    if not camera.distortions.any():
        return target
    k1, k2, p1, p2, k3 = camera.distortions
    # Start inside the one-to-one range, so that Newton stays on the right branch.
    limit = 0.98 * camera.max_radius
    radius = np.linalg.norm(target, axis=-1, keepdims=True)
    xy = target * np.minimum(1.0, limit / np.maximum(radius, 1e-12))
    for _ in range(iterations):
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))  # d radial / d r2, times 2
        a = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        d = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        b = x * y * slope + 2 * p1 * x + 2 * p2 * y
        error = distort(camera, xy) - target
        det = a * d - b * b
        det = np.where(np.abs(det) < 1e-6, 1e-6, det)
        step = np.stack([d * error[..., 0] - b * error[..., 1], a * error[..., 1] - b * error[..., 0]], axis=-1) / det[..., None]
        xy = xy - step
        radius = np.linalg.norm(xy, axis=-1, keepdims=True)
        xy = xy * np.minimum(1.0, limit / np.maximum(radius, 1e-12))
        if np.abs(step).max(initial=0.0) < 1e-12:
            break
    return xy


def backproject(camera: Camera, uv: np.ndarray) -> np.ndarray:
    """Unit rays of pixels, in the world's frame; each starts at ``camera.centre``.

    Parameters
    ----------
    camera : Camera
    uv : ndarray, shape (..., 2)
        Pixels.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit directions, world.
    """
    xy = undistort(camera, uv)
    rays = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1) @ camera.rotation
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def look_at(name: str, size: tuple[int, int], position, target, fov_deg: float, distortions=(0, 0, 0, 0)) -> Camera:
    """A camera at ``position`` that looks at ``target``, upright in a Z-up world.

    Parameters
    ----------
    name : str
    size : (width, height)
    position, target : array_like, shape (3,)
        World, metres. Looking straight down or up is fine; the image's top then points along world Y.
    fov_deg : float
        Horizontal field of view of the undistorted camera, degrees.
    distortions : array_like
        k1, k2, p1, p2.

    Returns
    -------
    Camera
    """
    position, target = np.asarray(position, float), np.asarray(target, float)
    forward = target - position
    forward = forward / np.linalg.norm(forward)
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    focal = size[0] / 2 / np.tan(np.radians(fov_deg) / 2)
    matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    return Camera(name, size, matrix, np.asarray(distortions, float), rotation, -rotation @ position)


def _beyond_k3(distortions: np.ndarray) -> str:
    """What a lens model longer than five numbers has that is not zero, in OpenCV's order."""
    names = ("k4, k5, k6 (the rational model)", "s1 to s4 (thin prism)", "tilt")
    parts = (distortions[5:8], distortions[8:12], distortions[12:])
    return " and ".join(name for name, part in zip(names, parts, strict=True) if part.any())


def _rotation_from_vector(vector: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix() if np.all(np.isfinite(vector)) else np.full((3, 3), np.nan)
