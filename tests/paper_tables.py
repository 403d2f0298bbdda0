"""Numbers printed in Rezaei & Akbarzadeh (2018), Tables 3-6 and Section 7.3, typed in for the tests."""

#: (z [m], theta [deg], phi [deg]) of the three examples of Tables 4-6.
EXAMPLES = ((0.4, 0.0, 0.0), (0.4, 25.0, 15.0), (0.4, -15.0, 10.0))

#: Table 4: per example and leg q [m], lambda, phi, theta [deg], as printed.
TABLE_4 = (
    (("0.4", "0", "0", "0"), ("0.4", "0", "0", "0"), ("0.4", "0", "0", "0")),
    (("0.35", "3.34", "15", "25"), ("0.51", "-0.34", "-28.9", "1.31"), ("0.36", "-3.01", "12.95", "-26.1")),
    (("0.37", "-1.32", "10", "-15"), ("0.38", "1.10", "7.7", "16.28"), ("0.46", "0.22", "-17.9", "-1.38")),
)

#: Table 5: per example (bodies, all): largest deflection [mm] and rotation [deg].
TABLE_5 = (
    (("5.708", "6.167"), ("1.988", "2.056")),
    (("11.811", "12.258"), ("3.328", "3.436")),
    (("8.815", "9.309"), ("2.651", "2.744")),
)

#: Table 6: per example, (bodies, all) for x, y, z [mm] and theta, phi, lambda [deg].
TABLE_6 = (
    (
        ("4.023", "4.351"),
        ("3.932", "4.260"),
        ("0.967", "0.975"),
        ("1.128", "1.136"),
        ("1.128", "1.136"),
        ("1.187", "1.282"),
    ),
    (
        ("9.646", "10.035"),
        ("6.854", "7.220"),
        ("3.501", "3.682"),
        ("1.851", "1.903"),
        ("1.957", "2.016"),
        ("1.984", "2.065"),
    ),
    (
        ("6.878", "7.316"),
        ("5.697", "6.150"),
        ("2.390", "2.505"),
        ("1.481", "1.530"),
        ("1.502", "1.548"),
        ("1.683", "1.778"),
    ),
)

#: Table 3, analytical columns: wrench [N, N m], (bodies, all) deflection [mm], (bodies, all) rotation [deg].
TABLE_3 = (
    ((0, 0, -300, 0, 0, 100), (1.6796, 1.6648), (1.0659, 1.1615)),
    ((300, 300, 300, 100, 100, 100), (5.3094, 5.6919), (1.7484, 1.8199)),
    ((300, 0, -300, -100, 100, 0), (5.5873, 5.9161), (1.8545, 1.8815)),
)
TABLE_3_POSE = (0.4, -15.0, 10.0)

#: Lower ends of the general compliance error range at z = 0.3 m [mm, deg].
GCER_LOWER = ("4.47", "1.85")

#: Permissible wrench: every component within +- these [N, N m].
PERMISSIBLE = (300.0, 300.0, 300.0, 100.0, 100.0, 100.0)
