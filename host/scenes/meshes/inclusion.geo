// A block of soft tissue with a stiff ball in it. Lengths in millimetres.
SetFactory("OpenCASCADE");
Box(1) = {-40, -40, -40, 80, 80, 40};
Sphere(2) = {12, 0, -13, 8};
Rectangle(11) = {6, -6, 0, 12, 12};   // a fingertip above the ball
Rectangle(12) = {-18, -6, 0, 12, 12}; // and one beside it
BooleanFragments{ Volume{1}; Delete; }{ Volume{2}; Surface{11, 12}; Delete; }
Physical Volume("inclusion") = {2};
Physical Volume("tissue") = {3};
bottom() = Surface In BoundingBox {-41, -41, -41, 41, 41, -39};
Physical Surface("bottom") = bottom();
above() = Surface In BoundingBox {5, -7, -1, 19, 7, 1};
Physical Surface("above") = above();
beside() = Surface In BoundingBox {-19, -7, -1, -5, 7, 1};
Physical Surface("beside") = beside();
MeshSize { PointsOf { Volume{3}; } } = 20;
MeshSize { PointsOf { Volume{2}; } } = 10;
MeshSize { PointsOf { Surface{above(), beside()}; } } = 4;
