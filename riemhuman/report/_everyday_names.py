"""Names of measurements that people use, for sheets and the report."""

from __future__ import annotations

from collections.abc import Mapping

# Measurements that people ask for, by group, with the names that people use.
KEY_GROUPS: Mapping[str, Mapping[str, str]] = {
    "Whole body": {
        "stature": "Stature",
        "body mass": "Weight, estimated",
        "surface area": "Surface area",
    },
    "Neck and trunk": {
        "neck girth": "Neck girth",
        "shoulder (biacromial) breadth": "Shoulder breadth",
        "chest girth": "Chest girth",
        "under-bust girth": "Under-bust girth",
        "waist girth": "Natural waist girth",
        "waist girth (omphalion)": "Waist at the navel",
        "hip girth": "Hip girth",
        "back length": "Back length",
    },
    "Arms": {
        "arm length": "Arm length",
        "upper arm girth": "Upper arm girth",
        "forearm girth": "Forearm girth",
        "wrist girth": "Wrist girth",
    },
    "Legs": {
        "inside leg height": "Inside leg",
        "outside leg length": "Outside leg",
        "thigh girth": "Thigh girth",
        "knee girth": "Knee girth",
        "calf girth": "Calf girth",
        "ankle girth": "Ankle girth",
        "foot length": "Foot length",
    },
}
# Names of others without the words of anatomists.
_PLAIN_NAMES: Mapping[str, str] = {
    "cervical height": "Height of the neck's base",
    "waist height (omphalion)": "Navel height",
    "suprasternale height": "Breastbone height",
    "iliocristale height": "Hip bone height",
    "trochanter height": "Height of the thigh bone",
    "knee height (midpatella)": "Kneecap height",
    "lateral epicondyle height": "Outer knee height",
    "tibial height": "Height of the shin bone",
    "tragion to crown": "Ear to crown",
    "arm length along joints": "Arm length between joints",
    "back length (omphalion)": "Back length to the navel",
    "front length (omphalion)": "Front length to the navel",
    "crotch length (omphalion)": "Crotch length at the navel",
    "posterior crotch length (omphalion)": "Crotch length, back half",
    "back breadth (interscye)": "Back breadth at the armpits",
    "back breadth (midscye)": "Back breadth above the armpits",
    "bitragion-chin arc": "Ear to ear by the chin",
    "bitragion-submandibular arc": "Ear to ear below the jaw",
    "waist breadth (omphalion)": "Waist breadth at the navel",
    "waist depth (omphalion)": "Waist depth at the navel",
    "iliac crest breadth": "Hip bone breadth",
    "interpupillary breadth": "Between the pupils",
}


def everyday_name(name: str) -> str:
    """Return the name that people use for a measurement of the library."""
    for group in KEY_GROUPS.values():
        if name in group:
            return group[name]
    return _PLAIN_NAMES.get(name, name[:1].upper() + name[1:])
