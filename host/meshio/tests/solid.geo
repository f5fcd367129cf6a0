// A box of 20 mm x 10 mm x 10 mm in two halves, at order 2, with physical groups of every dimension.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 0.01, 0.01, 0.01};
Box(2) = {0.01, 0, 0, 0.01, 0.01, 0.01};
BooleanFragments{ Volume{1}; Delete; }{ Volume{2}; Delete; }
Mesh.MeshSizeMin = 0.01;
Mesh.MeshSizeMax = 0.01;
Mesh.ElementOrder = 2;
Physical Volume("soft") = {1};
Physical Volume("stiff") = {2};
Physical Volume("body") = {1, 2};
Physical Surface("left") = Surface In BoundingBox {-1e-6, -1, -1, 1e-6, 1, 1};
Physical Surface("right") = Surface In BoundingBox {0.02-1e-6, -1, -1, 0.02+1e-6, 1, 1};
Physical Curve("rim") = Curve In BoundingBox {0.02-1e-6, -1, -1, 0.02+1e-6, 1, 1};
Physical Point("tip") = Point In BoundingBox {-1e-6, -1e-6, -1e-6, 1e-6, 1e-6, 1e-6};
// To make `solid.msh`, with Gmsh 4.8.4:
//   gmsh -3 solid.geo -format msh41 -o solid.msh
// and after it what follows $EndMeshFormat in quality.msh, a field over the tetrahedra, of
//   Merge "solid.msh";
//   Plugin(AnalyseMeshQuality).ICNMeasure = 1;
//   Plugin(AnalyseMeshQuality).CreateView = 1;
//   Plugin(AnalyseMeshQuality).DimensionOfElements = 3;
//   Plugin(AnalyseMeshQuality).Run;
//   PostProcessing.SaveMesh = 0;
//   Save View[0] "quality.msh";
