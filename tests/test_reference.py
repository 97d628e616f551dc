"""The reference against cases worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from compare import blocks_of_box
from reference import (
    AREA_MORE_POINTS,
    AREA_POINTS,
    AREA_TOLERANCE,
    FREE,
    RULES,
    Array,
    Camera,
    Model,
    RuleName,
    View,
    area,
    doubtful,
    evaluate,
    frustum_blocks,
    ideal,
    integrate,
    interpolate,
    layer,
    layer_index,
    mean_of_points,
    min_layer,
    pyramid,
)

NAN, INF = np.nan, np.inf
MODEL = Model((0.6, 0.0, 0.0))


def view_of(depth: Array, f: float = 1.0, voxel_size: float = 1.0, max_range: float = 100.0) -> View:
    """A camera at the origin that looks along z, with pixel (0, 0) on its axis."""
    image = np.asarray(depth, dtype=np.float32)
    camera = Camera(image.shape[1], image.shape[0], f, f, 0.0, 0.0)
    return View(image, camera, np.eye(4), voxel_size, MODEL, max_range)


def at(model: Model, z: float, z_j: float) -> float:
    return float(model.log_odds(np.array(z), np.array(z_j)))


def logit(p: float) -> float:
    return math.log(p / (1 - p))


def test_ranges_are_euclidean_and_say_what_each_reading_means() -> None:
    view = view_of(np.array([[2, 2, 2], [0, NAN, -1], [INF, 50, 80]]))
    r2, r6 = math.sqrt(2), math.sqrt(6)
    free = [[2, 2 * r2, 2 * math.sqrt(5)], [NAN, NAN, NAN], [INF, INF, INF]]
    assert 50 * r6 > view.max_range  # pixel (1, 2) lies on the ray (1, 2, 1)
    np.testing.assert_allclose(view.ranges(), free, rtol=1e-7)
    ignore = View(view.depth, view.camera, view.world_from_camera, 1.0, MODEL, 100.0, "ignore")
    np.testing.assert_allclose(ignore.ranges(), [free[0], free[1], [INF, NAN, NAN]], rtol=1e-7)
    assert view.ranges()[0, 1] == np.float32(view.ranges()[0, 1])


def test_sensor_model_is_eq_7() -> None:
    a = 1 / math.sqrt(2 * math.pi)
    assert at(MODEL, 6.0, 6.0) == pytest.approx(logit(0.5 + a))
    assert at(MODEL, 5.4, 6.0) == pytest.approx(logit(0.3 + (a + 0.2) * math.exp(-0.5)))
    assert at(MODEL, 7.2, 6.0) == pytest.approx(logit(0.5 + a * math.exp(-2)))
    assert at(MODEL, 1.0, 9.0) == pytest.approx(FREE)
    assert at(MODEL, 20.0, 9.0) == pytest.approx(0)
    assert at(MODEL, 20.0, INF) == FREE
    assert at(MODEL, 6 - 0.6 * math.sqrt(2 * math.log((a + 0.2) / 0.2)), 6.0) == pytest.approx(0, abs=1e-12)


def test_sensor_model_offsets_and_growing_sigma() -> None:
    assert at(Model((0.6, 0, 0), 1, "centred"), 6.0, 6.0) == pytest.approx(0, abs=1e-12)
    assert at(Model((0.6, 0, 0), 1, 0.25), 6.25, 6.0) == at(MODEL, 6.0, 6.0)
    growing = Model((0.1, 0.2, 0.3), 0.5)  # sigma(2) = 0.1 + 0.4 + 1.2
    a = 0.5 / math.sqrt(2 * math.pi)
    assert at(growing, 3.7, 2.0) == pytest.approx(logit(0.5 + a * math.exp(-0.5)))
    assert at(Model((0.1, 0.2, 0.3), 0.5, "centred"), 2.0, 2.0) == pytest.approx(0, abs=1e-12)


def test_layers_take_the_range_nearest_to_the_target() -> None:
    ranges = np.array([[1, 2, INF], [3, NAN, INF], [9, 5, NAN]], dtype=float)
    np.testing.assert_array_equal(layer(ranges, 0, 4.0), ranges)
    np.testing.assert_array_equal(layer(ranges, 1, 4.0), [[3, INF], [5, NAN]])
    np.testing.assert_array_equal(layer(ranges, 1, 2.5), [[2, INF], [5, NAN]])  # a tie takes the smaller
    np.testing.assert_array_equal(layer(ranges, 2, 8.0), [[9]])  # inf only if there is nothing else
    np.testing.assert_array_equal(layer(ranges, 1, None), [[1, INF], [5, NAN]])


def test_layer_thresholds_and_choice() -> None:
    view = view_of(np.ones((9, 17)), f=4.0, voxel_size=2.0)
    np.testing.assert_array_equal(view.thresholds(), [8, 4, 2, 1])  # 2^3 <= 9 < 2^4
    z = np.array([8.1, 8.0, 4.1, 4.0, 1.1, 1.0, 0.1])
    np.testing.assert_array_equal(layer_index(view.thresholds(), z), [-1, 0, 0, 1, 2, 3, 3])
    anamorphic = Camera(4, 4, 2.0, 8.0, 0, 0)
    view = View(np.ones((4, 4), np.float32), anamorphic, np.eye(4), 1.0, MODEL)
    np.testing.assert_array_equal(view.thresholds(), [4, 2, 1])


def test_interpolation_of_log_odds() -> None:
    texels = np.array([[5.0, 6.0], [7.0, NAN]])
    z = np.array([5.5])

    def around(u: float, v: float, i: int = 0) -> float:
        return float(interpolate(MODEL, texels, i, np.array([u]), np.array([v]), z)[0])

    l5, l6, l7 = (at(MODEL, 5.5, z_j) for z_j in (5.0, 6.0, 7.0))
    assert around(0.25, 0) == pytest.approx(0.75 * l5 + 0.25 * l6)
    assert around(0, 0.25) == pytest.approx(0.75 * l5 + 0.25 * l7)
    assert around(-0.4, 0) == pytest.approx(l5)  # clamped
    assert around(0.5, 0.5) == pytest.approx((l5 + l6 + l7) / 3)  # renormalised
    assert math.isnan(around(1, 1))  # the other texels have no weight
    assert around(1, 0.9) == pytest.approx(l6)
    # The middle of texel (0, 0) of layer 1 is pixel 0.5, between pixels 0 and 1.
    assert around(0.5, 0.5, i=1) == pytest.approx(l5)
    assert around(1.5, 0.5, i=1) == pytest.approx((l5 + l6) / 2)


def test_pyramid_blends_two_layers() -> None:
    # t = (8, 4, 2). Voxels near pixel (0, 0) see 5 in layer 0 and in layer 1 the nearest to 4, which is 4.5.
    depth = np.full((4, 4), 30.0)
    depth[0, 0], depth[1, 1] = 5.0, 4.5 / math.sqrt(1 + 2 / 64)
    view = view_of(depth, f=8.0)
    centres = np.array([[0, 0, 5.0], [0, 0, 8.0], [0, 0, 9.0]])
    l5, l45 = (MODEL.log_odds(centres[:, 2], np.full(3, z_j)) for z_j in (5.0, 4.5))
    np.testing.assert_allclose(pyramid(view, centres), [0.25 * l5[0] + 0.75 * l45[0], l5[1], l5[2]], rtol=1e-6)
    depth[0, 0] = 0
    np.testing.assert_allclose(pyramid(view_of(depth, f=8.0), centres), [l45[0], l45[1], NAN], rtol=1e-6)
    depth[:] = [[0] * 4, [0] * 4, [9] * 4, [9] * 4]
    assert np.isnan(pyramid(view_of(depth, f=8.0), centres)).all()  # layer 1 sees row 0 at pixel (0, 0)


def test_min_layer_takes_one_layer_and_the_minimum() -> None:
    depth = np.full((4, 4), 6.0)
    depth[0, 0] = 3.0
    view = view_of(depth, f=8.0)
    z = np.array([5.0, 3.9])  # layers 0 and 1; the pixel (0, 0) lies 1/4 of a texel off the middle of its texel
    near, far = MODEL.log_odds(z, np.full(2, 3.0)), MODEL.log_odds(z, np.full(2, 6.0))
    np.testing.assert_allclose(min_layer(view, np.array([[0, 0, 5.0], [0, 0, 3.9]])), near, rtol=1e-6)
    centre = np.array([[1.5 * 3.9 / 8, 0, 3.9]])  # half-way between the first two texels of layer 1
    distance = np.linalg.norm(centre, axis=1)
    first, second = MODEL.log_odds(distance, np.array([3.0])), MODEL.log_odds(distance, view.ranges()[:1, 2])
    np.testing.assert_allclose(min_layer(view, centre), (first + second) / 2, rtol=1e-6)
    assert far[1] != near[1]


def test_ideal_weighs_rays_by_their_length_in_the_voxel() -> None:
    # Two rays from (0.2, 0.5, 0): along z through the whole voxel [0, 1) x [0, 1) x [4, 5), and along (1, 0, 6.25),
    # which leaves it through x = 1 at z = 5: it runs sqrt(1 + 6.25^2) / 6.25 inside. The third meets none asked for.
    camera = Camera(3, 1, 6.25, 6.25, 0.0, 0.0)
    pose = np.eye(4)
    pose[:3, 3] = 0.2, 0.5, 0
    view = View(np.array([[4, 5, 4]], np.float32), camera, pose, 1.0, MODEL, 100.0)
    slant = math.sqrt(1 + 6.25**2) / 6.25
    centre = np.array([[0.5, 0.5, 4.5]])
    z = math.hypot(0.3, 4.5)
    expected = (at(MODEL, z, 4.0) * 1 + at(MODEL, z, 5 * slant) * slant) / (1 + slant)
    np.testing.assert_allclose(ideal(view, centre), [expected], rtol=1e-6)
    # One voxel on, the second ray has left, through x = 1 at z = 5.
    np.testing.assert_allclose(
        ideal(view, centre + np.array([0, 0, 1])), [at(MODEL, math.hypot(0.3, 5.5), 4.0)], rtol=1e-6
    )
    blind = View(np.array([[0, NAN, -2]], np.float32), camera, pose, 1.0, MODEL, 100.0)
    assert np.isnan(ideal(blind, centre)).all()


def test_ideal_inside_the_cameras_own_voxel() -> None:
    # From (0.5, 0.5, 0.25), rays along z and (1, 0, 1): 0.75 and 0.5 sqrt(2) long up to the faces z = 1 and x = 1.
    pose = np.eye(4)
    pose[:3, 3] = 0.5, 0.5, 0.25
    view = View(np.array([[0.5, 1.0]], np.float32), Camera(2, 1, 1.0, 1.0, 0.0, 0.0), pose, 1.0, MODEL)
    expected = 0.75 * at(MODEL, 0.25, 0.5) + 0.5 * math.sqrt(2) * at(MODEL, 0.25, math.sqrt(2))
    expected /= 0.75 + 0.5 * math.sqrt(2)
    np.testing.assert_allclose(ideal(view, np.array([[0.5, 0.5, 0.5]])), [expected], rtol=1e-6)


def test_area_is_the_mean_over_points_inside_the_voxel() -> None:
    # A voxel 3.5 to 4.5 m in front of 2x2 pixels that meet on its middle. Two of the first eight points are in each;
    # where these do not settle it, so many of all 56 are.
    points = np.concatenate([AREA_POINTS, AREA_MORE_POINTS])
    right, below = points[:, 0] > 0, points[:, 1] > 0
    w = np.array([[np.sum((below == row) & (right == column)) for column in (0, 1)] for row in (0, 1)])
    assert w.sum() == 56
    camera = Camera(2, 2, 1.0, 1.0, 0.5, 0.5)
    pose = np.eye(4)
    pose[:3, 3] = 0.5, 0.5, -3.5
    centre = np.array([[0.5, 0.5, 0.5]])

    def seen(depth: list[list[float]], camera: Camera = camera) -> float:
        return float(area(View(np.array(depth, np.float32), camera, pose, 1.0, MODEL, 100.0), centre)[0])

    # (rel: ranges are rounded to float32)
    slant = math.sqrt(1 + 0.5**2 + 0.5**2)
    near, far = at(MODEL, 4.0, 3.5 * slant), at(MODEL, 4.0, 4.5 * slant)
    assert seen([[3.5, 4.5], [4.5, 4.5]]) == pytest.approx((w[0, 0] * near + (56 - w[0, 0]) * far) / 56, rel=1e-5)
    diagonal = (w[1, 0] * near + w[0, 1] * far) / (w[1, 0] + w[0, 1])
    assert seen([[0.0, 4.5], [3.5, NAN]]) == pytest.approx(diagonal, rel=1e-5)
    assert seen([[INF, INF], [INF, 3.5]]) == pytest.approx((w[1, 1] * near + (56 - w[1, 1]) * FREE) / 56, rel=1e-5)
    assert math.isnan(seen([[0.0, 0.0], [NAN, -1.0]]))
    # What differs by less than the tolerance is settled by the first eight.
    alike = at(MODEL, 4.0, 4.5 * slant), at(MODEL, 4.0, 4.6 * slant)
    assert 0 < abs(alike[1] - alike[0]) < AREA_TOLERANCE
    assert seen([[4.5, 4.6], [4.6, 4.6]]) == pytest.approx((alike[0] + 3 * alike[1]) / 4, rel=1e-5)
    # An image of the left column alone: the points right of it see its pixels.
    rows = (w[0].sum() * near + w[1].sum() * far) / 56
    assert seen([[3.5], [4.5]], Camera(1, 2, 1.0, 1.0, 0.5, 0.5)) == pytest.approx(rows, rel=1e-5)
    assert seen([[3.5], [0.0]], Camera(1, 2, 1.0, 1.0, 0.5, 0.5)) == pytest.approx(near, rel=1e-5)


def test_area_asks_more_points_where_eight_do_not_settle_it() -> None:
    few = np.array([[0.1, 0.1, NAN, NAN], [0.3, 0.9, NAN, NAN], [NAN, NAN, NAN, NAN]])
    more = np.array([[2.0, 0.2, NAN, NAN], [2.0, NAN, 3.0, NAN], [2.0, 0.4, 4.0, NAN]])
    np.testing.assert_allclose(mean_of_points(few, more), [0.2, 1.6 / 4, 3.5, NAN])


def test_area_leaves_out_points_behind_the_camera() -> None:
    # The camera stands at z = 0.3 in the voxel [0, 1]^3. The points before it see the pixel left or right of the axis.
    pose = np.eye(4)
    pose[:3, 3] = 0.5, 0.5, 0.3
    image = np.array([[0.1, 5.0]], np.float32)
    view = View(image, Camera(2, 1, 1.0, 1.0, 0.5, 0.0), pose, 1.0, MODEL)
    # What these see differs by more than the tolerance, so that all points are asked.
    points = np.concatenate([AREA_POINTS, AREA_MORE_POINTS])
    left = sum(1 for x, _, z in points if z + 0.5 > 0.3 and x < 0)
    right = sum(1 for x, _, z in points if z + 0.5 > 0.3 and x > 0)
    assert left + right < 56
    l_left, l_right = (at(MODEL, 0.2, z_j) for z_j in (0.1 * math.sqrt(1.25), 5 * math.sqrt(1.25)))
    expected = (left * l_left + right * l_right) / (left + right)
    assert area(view, np.array([[0.5, 0.5, 0.5]]))[0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("rule", RULES)
def test_only_voxels_in_the_image_and_in_range_are_touched(rule: RuleName) -> None:
    """A 4x4 image looks along world -x from (10, 0, 0), with y to its right and z downwards; f = 1, centre 1.5."""
    pose = np.array([[0, 0, -1, 10], [1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=float)
    view = View(np.full((4, 4), INF, np.float32), Camera(4, 4, 1.0, 1.0, 1.5, 1.5), pose, 1.0, MODEL, max_range=6.0)
    result = evaluate(view, rule, np.array([0, -8, -8]), (16, 16, 16))
    x, y, z = (np.indices((16, 16, 16)) + np.array([0, -8, -8])[:, None, None, None]) + 0.5
    forward = 10 - x
    # u = y / forward + 1.5 and v = -z / forward + 1.5, both in [-0.5, 3.5)
    inside = (forward > 0) & (y >= -2 * forward) & (y < 2 * forward) & (z > -2 * forward) & (z <= 2 * forward)
    inside &= forward**2 + y**2 + z**2 <= 36
    if rule == "ideal":  # some voxels in the image are cut by none of so few rays
        assert (inside | np.isnan(result)).all()
        assert np.isfinite(result).sum() > 50
    else:
        np.testing.assert_array_equal(np.isfinite(result), inside)
    np.testing.assert_allclose(result[np.isfinite(result)], FREE)


def test_increments_are_rounded_and_sums_of_zero_are_unknown() -> None:
    view = view_of(np.full((4, 4), 4.0), f=8.0)
    log_odds, doubt = integrate([view, view], "min_layer", np.array([0, 0, 0]), (8, 8, 16))
    once = evaluate(view, "min_layer", np.array([0, 0, 0]), (8, 8, 16))
    np.testing.assert_array_equal(log_odds, 2 * np.rint(np.nan_to_num(once) * 4096) / 4096)
    assert (log_odds[0, 0, 8:] == 0).all()  # 4 m behind the surface nothing is known
    assert np.isfinite(once[0, 0, 8:]).all()
    assert not doubt[log_odds < -0.1].any()


def test_doubt_is_on_borders_and_nowhere_else() -> None:
    pose = np.eye(4)
    pose[:3, 3] = 0.25
    view = View(np.full((8, 8), 3.0, np.float32), Camera(8, 8, 8.0, 8.0, 3.5, 3.5), pose, 0.5, MODEL, max_range=3.5)
    first, shape = np.array([-8, -8, 0]), (16, 16, 16)
    exact = evaluate(view, "pyramid", first, shape)
    doubt = doubtful(view, "pyramid", first, shape, exact)
    x, y, z = (np.indices(shape) + first[:, None, None, None]) * 0.5  # of the centres, from the camera
    lateral, z2 = np.maximum(abs(x), abs(y)), x**2 + y**2 + z**2
    border = (lateral == z / 2) & (z > 0) & (z2 <= 3.5**2)  # u = 8 x / z + 3.5 meets the image's border at |x| = z / 2
    border |= (z2 == 3.5**2) & (lateral <= z / 2)
    assert border.any()
    np.testing.assert_array_equal(doubt, border)


def test_box_around_the_views_holds_all_they_see() -> None:
    pose = np.eye(4)
    pose[:3, 3] = -3.2, 1.1, 0.4
    view = View(np.full((6, 8), INF, np.float32), Camera(8, 6, 5.0, 6.0, 3.0, 2.0), pose, 0.2, MODEL, 2.0)
    first, shape = frustum_blocks([view])
    seen = np.argwhere(~np.isnan(evaluate(view, "min_layer", first, shape))) + first
    wider = np.argwhere(~np.isnan(evaluate(view, "min_layer", first - 8, [n + 16 for n in shape]))) + first - 8
    np.testing.assert_array_equal(seen, wider)
    assert len(seen) > 100
    assert blocks_of_box(integrate([view], "min_layer", first, shape)[0], first)


def test_moving_camera_and_map_together_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 3, (12, 16)).astype(np.float32)
    camera = Camera(16, 12, 14.0, 13.0, 7.3, 5.9)
    first, shape = np.array([-8, -8, 0]), (16, 16, 24)

    def value(rule: RuleName, shift: Array) -> Array:
        pose = np.eye(4)
        pose[:3, 3] = [0.03, 0.01, 0.02] + shift * 0.25
        return evaluate(View(depth, camera, pose, 0.25, MODEL, 4.0), rule, first + shift.astype(int), shape)

    for rule in RULES:
        shifted = value(rule, np.array([-9.0, 4.0, 17.0]))
        np.testing.assert_allclose(value(rule, np.zeros(3)), shifted, atol=1e-9)
