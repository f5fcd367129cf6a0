// A block of soft tissue with a stiff ball in it. Lengths in millimetres.
SetFactory("OpenCASCADE");
Box(1) = {-40, -40, -40, 80, 80, 40};
Sphere(2) = {12, 0, -13, 8};
BooleanFragments{ Volume{1}; Delete; }{ Volume{2}; Delete; }
Physical Volume("inclusion") = {2};
Physical Volume("tissue") = {3};
bottom() = Surface In BoundingBox {-41, -41, -41, 41, 41, -39};
Physical Surface("bottom") = bottom();
Mesh.MeshSizeMax = 9;
MeshSize { PointsOf { Volume{2}; } } = 5;
