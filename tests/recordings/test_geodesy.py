"""WGS84 against published and derived values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from belie.recordings.geodesy import GeodeticPoint, ecef_m, enu_m, geodetic, geodetic_of_enu


def at(latitude, longitude, altitude=0.0):
    return GeodeticPoint(latitude_deg=latitude, longitude_deg=longitude, altitude_m=altitude)


def test_the_pole_is_at_the_semi_minor_axis():
    np.testing.assert_allclose(ecef_m(at(90.0, 0.0)), [0.0, 0.0, 6356752.314245], atol=1e-5)


def test_a_degree_of_latitude():
    # Length of a meridian arc of 1/1000 degree: 110.574 m at the equator, 111.694 m at the poles.
    assert enu_m(at(0.001, 0.0), at(0.0, 0.0))[1] == pytest.approx(110.574, abs=2e-3)
    assert enu_m(at(90.0, 0.0), at(89.999, 0.0))[1] == pytest.approx(111.694, abs=2e-3)


def test_axes_are_east_north_up():
    origin = at(48.0, 11.0, 500.0)
    east, north, up = at(48.0, 11.0001, 500.0), at(48.0001, 11.0, 500.0), at(48.0, 11.0, 510.0)
    for axis, point in enumerate((east, north, up)):
        position = enu_m(point, origin)
        assert int(np.argmax(np.abs(position))) == axis
        assert position[axis] > 0.0


@given(
    st.floats(-89.99, 89.99), st.floats(-180.0, 180.0), st.floats(-100.0, 9000.0), st.floats(-5000.0, 5000.0)
)
def test_round_trips(latitude, longitude, altitude, offset_m):
    origin = at(latitude, longitude, altitude)
    np.testing.assert_allclose(ecef_m(geodetic(ecef_m(origin))), ecef_m(origin), atol=1e-8)
    position = np.array([offset_m, -offset_m / 3.0, 12.0])
    np.testing.assert_allclose(enu_m(geodetic_of_enu(position, origin), origin), position, atol=1e-8)
