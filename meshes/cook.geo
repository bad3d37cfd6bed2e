// Cook's membrane: a tapered panel, held on the left and sheared on the right.
// R. D. Cook, J. Struct. Div. ASCE 100 (1974) 1851-1863. Lengths in m.
size = 2.0;  // of elements; body.mesh_size in a scene overrides it

Point(1) = {0, 0, 0, size};
Point(2) = {48, 44, 0, size};
Point(3) = {48, 60, 0, size};
Point(4) = {0, 44, 0, size};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

Physical Curve("bottom") = {1};
Physical Curve("right") = {2};
Physical Curve("top") = {3};
Physical Curve("left") = {4};
Physical Surface("panel") = {1};
