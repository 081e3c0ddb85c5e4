MODULE M
  CONST robtarget p2:=[[120,5,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PERS pose d:=[[1,2,3],[1,0,0,0]];
  PROC main()
    path;
    PDispSet d;
    path;
    PDispOff;
  ENDPROC
  PROC path()
    MoveL RelTool(p2,0,0,-5),v100,fine,tool0;
    MoveL RelTool(p2,0,0,-9),v100,fine,tool0;
  ENDPROC
ENDMODULE
