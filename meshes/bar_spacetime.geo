// Space-time mesh of a bar: layers of right triangles. First coordinate t [s], second x [m] from the end that faces the wall.
// The numbers are those of the scene it is used with: T its duration, L the bar's length, c = sqrt(E / rho).

T = 5.0;           // duration [s]
L = 1.0;           // length [m]
c = 1.0;           // wave speed [m/s]
n = 40;            // elements along the bar
courant = 1.0;     // c dt / h, at most 1

layers = Round(T * c * n / (courant * L));

Point(1) = {0, 0, 0};
Point(2) = {T, 0, 0};
Point(3) = {T, L, 0};
Point(4) = {0, L, 0};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};

Transfinite Curve {1, 3} = layers + 1;
Transfinite Curve {2, 4} = n + 1;
Transfinite Surface {1} Right;

Physical Curve("wall") = {1};
Physical Curve("end") = {2};
Physical Curve("far") = {3};
Physical Curve("start") = {4};
Physical Surface("bar") = {1};
