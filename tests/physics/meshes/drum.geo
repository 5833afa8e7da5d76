// A cast-iron cup, its elements narrow towards the corner of ring and plate: ring 12 mm, 60 mm wide, plate 8 mm, hub 50 mm, inner radius 100 mm. Lengths in m.
R = 0.1; h = 0.012; w = 0.06; p = 0.008; hub = 0.05;
DefineConstant[ THROUGH = 4, ALONG = 8, PLATE = 9, LAYERS = 12, NARROW = 1.6, NARROW_ALONG = 0.72 ];
Point(1) = {hub, 0, w/2}; Point(2) = {R, 0, w/2}; Point(3) = {R+h, 0, w/2};
Point(4) = {hub, 0, w/2+p}; Point(5) = {R, 0, w/2+p}; Point(6) = {R+h, 0, w/2+p};
Point(7) = {R, 0, -w/2}; Point(8) = {R+h, 0, -w/2};
Line(1) = {1,2}; Line(2) = {2,3}; Line(3) = {4,5}; Line(4) = {5,6}; Line(5) = {1,4}; Line(6) = {2,5}; Line(7) = {3,6};
Line(8) = {7,8}; Line(9) = {7,2}; Line(10) = {8,3};
Curve Loop(1) = {1,6,-3,-5}; Plane Surface(1) = {1};
Curve Loop(2) = {2,7,-4,-6}; Plane Surface(2) = {2};
Curve Loop(3) = {8,10,-2,-9}; Plane Surface(3) = {3};
Transfinite Curve {1,3} = PLATE+1 Using Bump 0.25;
Transfinite Curve {2,4,5,6,7,8} = THROUGH+1 Using Progression NARROW;
Transfinite Curve {9,10} = ALONG+1 Using Progression NARROW_ALONG;
Transfinite Surface {1,2,3}; Recombine Surface {1,2,3};
s[] = {1,2,3}; v[] = {}; c[] = {};
For q In {1:4}
  For k In {0:2}
    e[] = Extrude {{0,0,1},{0,0,0},Pi/2} {Surface{s[k]}; Layers{LAYERS}; Recombine;};
    s[k] = e[0]; v[] += e[1];
    If (k == 0) c[] += e[5]; EndIf
  EndFor
EndFor
Coherence;
Physical Volume("IRON") = {v[]};
Physical Surface("HUB") = {c[]};
