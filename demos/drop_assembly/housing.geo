// Cross-section of a housing, 80 x 24 mm, walls of 2 mm, outer edges rounded; inside two stand-offs
// for the board and the seat of the foam pad. Lengths in m.
SetFactory("OpenCASCADE");
Rectangle(1) = {-0.040, 0.000, 0, 0.080, 0.024, 0.004};
Rectangle(2) = {-0.038, 0.002, 0, 0.076, 0.020, 0.002};
walls() = BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; };
Rectangle(3) = {-0.028, 0.001, 0, 0.006, 0.011};
Rectangle(4) = {0.022, 0.001, 0, 0.006, 0.011};
Rectangle(5) = {-0.016, 0.001, 0, 0.030, 0.0015};
part() = BooleanUnion{ Surface{walls()}; Delete; }{ Surface{3, 4, 5}; Delete; };
e = 1e-5;
post_1() = Curve In BoundingBox {-0.028 - e, 0.012 - e, -e, -0.022 + e, 0.012 + e, e};
post_2() = Curve In BoundingBox {0.022 - e, 0.012 - e, -e, 0.028 + e, 0.012 + e, e};
seat() = Curve In BoundingBox {-0.016 - e, 0.0025 - e, -e, 0.014 + e, 0.0025 + e, e};
underside() = Curve In BoundingBox {-0.040 - e, -e, -e, 0.040 + e, e, e};
underside() += Curve In BoundingBox {-0.040 - e, -e, -e, -0.036 + e, 0.004 + e, e};
underside() += Curve In BoundingBox {0.036 - e, -e, -e, 0.040 + e, 0.004 + e, e};
underside() -= Curve In BoundingBox {-0.038 - e, 0.002 - e, -e, 0.038 + e, 0.004 + e, e};   // inside
Physical Surface("plastic") = part();
Physical Curve("post_1") = post_1();
Physical Curve("post_2") = post_2();
Physical Curve("seat") = seat();
Physical Curve("underside") = underside();
