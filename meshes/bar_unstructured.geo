// Space-time mesh of a bar without layers, for docs/scripts/limits.py: the Galerkin method is NOT stable on it.
// First coordinate t [s], second x [m].

T = 5.0;           // duration [s], that of demos/bar_impact
L = 1.0;           // length [m]
n = 16;            // elements along the bar; start and end are divided alike
courant = 1.0;     // dt / h on the sides wall and far, for c = 1
algorithm = 5;     // Gmsh's number: 5 Delaunay, 6 frontal-Delaunay

layers = Round(T * n / (courant * L));
h = L / n;

Point(1) = {0, 0, 0, h};
Point(2) = {T, 0, 0, h};
Point(3) = {T, L, 0, h};
Point(4) = {0, L, 0, h};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

Transfinite Curve {1, 3} = layers + 1;
Transfinite Curve {2, 4} = n + 1;
Mesh.Algorithm = algorithm;

Physical Curve("wall") = {1};
Physical Curve("end") = {2};
Physical Curve("far") = {3};
Physical Curve("start") = {4};
Physical Surface("bar") = {1};
