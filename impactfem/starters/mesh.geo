// An oval plate with a hole for Gmsh, lengths in m. Physical names become the names of surfaces.
SetFactory("OpenCASCADE");
Disk(1) = {0, 0.026, 0, 0.05, 0.025};
Disk(2) = {0, 0.026, 0, 0.012, 0.012};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
edges() = Boundary{ Surface{3}; };
Physical Surface("plate") = {3};
Physical Curve("edge") = {edges(0)};
Physical Curve("hole") = {edges(1)};
Mesh.MeshSizeMax = 0.0018;
