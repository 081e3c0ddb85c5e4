MODULE TwoTools
  PERS tooldata tLong:=[TRUE,[[0,0,360],[1,0,0,0]],[18,[0,0,140],[1,0,0,0],0,0,0]];
  PROC main()
    Cut tMill;
    %"Cut"% tLong;
  ENDPROC
  PROC Cut(PERS tooldata t)
    MoveL [[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,t\WObj:=wPart;
    MoveL [[80,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,t\WObj:=wPart;
  ENDPROC
ENDMODULE
