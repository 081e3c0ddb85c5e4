MODULE Arc
  PROC main()
    MoveL [[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveC [[29.28932,70.71068,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[100,100,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[150,100,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
  ENDPROC
ENDMODULE
