"""The kinds of machines that are tried for a job: each is one of the catalog, varied."""

KINDS: dict[str, tuple[str, str]] = {
    "delta": ("base_radius platform_radius crank", "z"),
    "linear-delta": ("base_radius platform_radius", "z"),
    "orthoglide": ("", "xyz"),
    "tripteron": ("crank", "xyz"),
    "delta-4": ("base_radius platform_radius crank", "z"),
    "h4": ("base_radius crank", "yz"),
    "par4": ("base_radius crank", "z"),
    "quadrupteron": ("crank", "xyz"),
    "hexa": ("base_radius platform_radius crank", "z"),
    "hexaglide": ("base_radius platform_radius", "yz"),
    "stewart": ("base_radius platform_radius", "z"),
    "five-bar": ("base_radius crank", "y"),
    "3-rrr": ("base_radius platform_radius crank", "xy"),
    "3-prr": ("base_radius platform_radius", "xy"),
    "3-rpr": ("base_radius platform_radius", "xy"),
}
"""The dimensions of each kind that vary beside the size, and the coordinates of its place that do:
the others are those of its plane or axis of symmetry."""
