MODULE Shared
  ! One declared point is cut on two sides of the part: two corrections, one declaration. The last motion cuts nothing.
  PERS wobjdata wSide:=[FALSE,TRUE,"",[[1000,-320,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget pCorner:=[[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL pCorner,v20,fine,tMill\WObj:=wPart;
    MoveL [[120,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[120,80,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL pCorner,v20,fine,tMill\WObj:=wSide;
    ! deflex air
    MoveL pCorner,v20,fine,tMill\WObj:=wPart;
  ENDPROC
ENDMODULE
