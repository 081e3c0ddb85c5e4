MODULE Shared
  ! Both ends of the slot are the same declared point, reached along another way: two corrections, one declaration.
  CONST robtarget pCorner:=[[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL pCorner,v20,fine,tMill\WObj:=wPart;
    MoveL [[120,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[120,80,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL pCorner,v20,fine,tMill\WObj:=wPart;
    ! deflex air
    MoveL pCorner,v20,fine,tMill\WObj:=wPart;
  ENDPROC
ENDMODULE
