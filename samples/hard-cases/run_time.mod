MODULE RunTime
  CONST robtarget p10:=[[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  VAR num nFound;
  PROC main()
    VAR bool bOk;
    MoveL p10,v20,fine,tMill\WObj:=wPart;
    bOk:=StrToVal(ReadStr(dev1),nFound);
    MoveL Offs(p10,nFound,0,0),v20,fine,tMill\WObj:=wPart;
    MoveL CRobT(\Tool:=tMill\WObj:=wPart),v20,fine,tMill\WObj:=wPart;
    PDispSet [[0,0,5],[1,0,0,0]];
    MoveL [[40,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    PDispOff;
    MoveL [[80,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
  ENDPROC
  PROC Spare()
    MoveL [[90,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
  ENDPROC
ENDMODULE
