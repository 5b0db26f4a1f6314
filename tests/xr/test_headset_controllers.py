"""Other controllers than the scripted ones: the runtime's simulated ones, which only lie there."""

import pytest

PROFILES = {
    "wmr": "/interaction_profiles/microsoft/motion_controller",
    "simple": "/interaction_profiles/khr/simple_controller",
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", PROFILES)
def test_controllers_of_another_make_are_bound_and_seen(stand, start, kind):
    simulated = {"SIMULATED_ENABLE": "1", "SIMULATED_LEFT": kind, "SIMULATED_RIGHT": kind}
    program = start(stand, "--frames", "8", P_OVERRIDE_ACTIVE_CONFIG="none", **simulated)
    line = program.until(lambda line: line["focused"], "focused")
    report = program.end()
    assert report["code"] == 0
    assert report["profiles"] == dict.fromkeys(("left", "right"), PROFILES[kind])
    for hand in line["hands"].values():
        assert hand["active"] and hand["grip"] and hand["aim"]
        assert (hand["squeeze"], hand["trigger"], hand["stick"]) == (0, 0, [0, 0])
    assert "does not know" not in program.told()
